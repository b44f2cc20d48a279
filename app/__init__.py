"""The HTTP service of MorphID: validation, rows and events; it never computes a flight."""
