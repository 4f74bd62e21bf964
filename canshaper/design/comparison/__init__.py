"""Comparison of all filters on the same manoeuvres, crane, valves and output limits."""
