"""The operations of the API: one call each, built from their descriptors."""
