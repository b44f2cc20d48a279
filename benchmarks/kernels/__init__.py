"""Kernels that only benchmarks fly."""
