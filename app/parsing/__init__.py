"""Parsing of untrusted input in processes with limits; the API process sees only numbers and short texts."""
