"""The `morphid` command: runs the service, runs operations locally, and is a client of a service."""
