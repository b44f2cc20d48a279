"""The operations at the API: a call each, made of their descriptors."""
