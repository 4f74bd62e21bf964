"""Measuring a valve: at which command it opens, and what it gives in each direction."""
