"""Pure shaping: sway model, G_FF, limits, axis state machine. No I/O, no clock, plain floats."""
