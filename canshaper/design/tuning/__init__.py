"""Tuning on the desk, with the extra tools: optimal tuner (Eq. 14-15), manual rule, measures."""
