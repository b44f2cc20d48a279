"""The HTTP service of MorphID: validation, database rows and events; it never computes flights."""
