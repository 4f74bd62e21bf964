"""Nodes of CANopen by their EDS or DCF: what they send and receive, and what has to be set."""
