"""The black box: exactly what the daemon received, computed and sent in the last minute."""
