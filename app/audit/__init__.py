"""The audit log: one row per action, without secrets."""
