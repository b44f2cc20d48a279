"""Webhooks: messages to an address of the owner when a job ends."""
