"""Study of the number of links per wing: the request side."""
