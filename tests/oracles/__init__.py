"""Second implementations of what the product computes, each by a route of its own."""
