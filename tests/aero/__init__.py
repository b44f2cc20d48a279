"""Proofs of the aerodynamics."""
