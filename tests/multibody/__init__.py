"""Proofs of the multibody dynamics."""
