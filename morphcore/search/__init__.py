"""Search methods as swappable values with plain states, and the loop that drives them."""
