"""The closed loop on a real bus for a long time, with random faults; everything is counted."""
