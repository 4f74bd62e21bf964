"""Campaigns: the real controller drives many simulated cranes, drawn from what is uncertain."""
