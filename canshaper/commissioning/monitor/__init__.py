"""The state of a running daemon in the terminal, from CAN alone (never in the daemon)."""
