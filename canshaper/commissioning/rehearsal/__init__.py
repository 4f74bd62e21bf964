"""Faults rehearsed at the machine: what is expected, what happened, and the table to sign."""
