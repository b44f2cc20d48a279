"""Identified models as things of their own."""
