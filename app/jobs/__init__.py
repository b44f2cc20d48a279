"""Jobs: the authoritative rows for all long work."""
