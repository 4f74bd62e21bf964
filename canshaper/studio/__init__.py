"""The live page: a crane under the joystick, raw and shaped, in a browser (never in the daemon)."""
