"""The worker: claims queued jobs, runs them with morphcore, and records progress and results."""
