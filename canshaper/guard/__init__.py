"""The output guard: independent of what computes the frames that it looks at."""
