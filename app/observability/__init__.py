"""Logs, metrics and traces, shared by the API and the workers."""
