"""Benchmarks of this machine: speed, operations, memory, start, all beside what they must hold.

They stay in a checkout. Everything in one run (run.py), each figure in its own module, interleaved where
figures are compared.
"""
