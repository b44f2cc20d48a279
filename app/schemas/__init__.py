"""Documents that clients send, shared by several features."""
