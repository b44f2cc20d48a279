"""Simulation of one flight with any of the three models: the request side."""
