"""``morphid doctor``: checks this installation and suggests a remedy for every problem."""
