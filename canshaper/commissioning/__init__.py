"""Measuring a machine and its PC: identify, calibrate, doctor, monitor. Never in the daemon."""
