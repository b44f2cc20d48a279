"""What strangers send, read in processes with limits; the API process sees numbers and short texts only."""
