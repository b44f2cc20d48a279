"""The web page of the service: static files, no build step, nothing from other hosts."""
