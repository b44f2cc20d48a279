"""Columns of flights in files (CSV, JSON, Parquet, MATLAB), for the library and the service alike.

Nothing heavy is imported before a file of its kind is read, and nothing of the other packages ever.
"""
