"""``morphid doctor``: what is wrong with this installation, line by line, each with its remedy."""
