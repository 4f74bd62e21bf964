"""Faults rehearsed at the running machine; loaded where its file allows them only."""
