"""Frames in, frames out, without sockets and without a clock."""
