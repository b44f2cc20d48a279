"""One file for each command or group of commands; they import what they need when they run."""
