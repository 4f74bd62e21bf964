"""What a sway sensor shows: its sign, delay, offset and noise, out of a log of a drive."""
