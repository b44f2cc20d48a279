"""Webhooks: messages to a URL of the owner when a job ends."""
