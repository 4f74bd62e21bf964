"""Is this PC fit to run a deployment? The daemon's loop, measured here, with nothing on any bus."""
