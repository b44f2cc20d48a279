"""The `morphid` command: serves, identifies, talks to a service."""
