"""Identification of an equivalent model from sample flights: the request side."""
