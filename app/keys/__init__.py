"""API keys: identity, permissions and quotas of callers."""
