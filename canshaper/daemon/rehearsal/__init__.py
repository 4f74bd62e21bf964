"""Faults rehearsed at the running machine; loaded only if its deployment file allows them."""
