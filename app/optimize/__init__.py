"""Optimisation of a morph schedule: the request side."""
