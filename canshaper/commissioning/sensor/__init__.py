"""Sign, delay, offset and noise of a sway sensor, from the log of a drive."""
