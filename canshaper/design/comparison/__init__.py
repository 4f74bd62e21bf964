"""Every filter on the same work: the same manoeuvres, crane, valves and output limits."""
