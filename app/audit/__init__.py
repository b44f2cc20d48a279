"""Who did what, and when: one row per deed, never a secret in it."""
