"""Uploaded sample flights."""
