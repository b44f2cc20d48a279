"""Benchmarks of this machine: speed, operations, memory and start-up, next to their required bounds.

They are not part of the installed package. One run (run.py) does everything, each figure has its own module,
and compared figures are measured in alternation.
"""
