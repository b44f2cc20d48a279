"""Webhooks: a job's end is told to an address of its owner."""
