"""What the service tells about itself: logs, metrics, traces. Shared by the API and the workers."""
