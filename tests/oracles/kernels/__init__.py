"""Kernels of the textbook dynamics."""
