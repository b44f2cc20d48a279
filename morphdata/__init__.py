"""Every document that enters or leaves: fields, limits, checks and readers, for all rooms alike."""
