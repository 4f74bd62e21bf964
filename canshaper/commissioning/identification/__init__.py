"""Natural period, damping and full speed of the swing from logs, a phone or a stopwatch."""
