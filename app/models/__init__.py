"""Identified models as resources."""
