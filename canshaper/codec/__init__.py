"""Bytes of CAN frames to values and back: identifiers, layout, signals, directions, protection."""
