"""canshaper: sensor-less anti-sway for hydraulic cranes, between joystick and valves on CAN."""

__version__ = "0.1.0"
