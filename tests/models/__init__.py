"""Proofs of the equivalent model."""
