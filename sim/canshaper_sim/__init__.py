"""The simulated machine: valves, crane, hanging grapple and operator, on CAN or in lock-step."""
