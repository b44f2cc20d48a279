"""What the service reports about itself: logs, metrics, traces. Shared by the API and the workers."""
