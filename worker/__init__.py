"""The worker: claims queued jobs, lets morphcore do the work, writes what happens into the job store."""
