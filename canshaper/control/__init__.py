"""The control socket: numbers of a running daemon, asked for and changed by other programs."""
