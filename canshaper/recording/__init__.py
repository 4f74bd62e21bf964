"""Logs of CAN frames: reading, recording and replaying them (never in the daemon)."""
