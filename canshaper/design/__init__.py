"""Desk work: crane model, tuning, comparison. Never in the daemon."""
