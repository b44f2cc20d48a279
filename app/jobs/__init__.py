"""Jobs: the rows that are the truth about every piece of long work."""
