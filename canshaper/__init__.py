"""canshaper: sensor-less anti-sway for hydraulic cranes, between joystick and valves on CAN."""

__version__: str


def __getattr__(name: str) -> object:
    """Look the version up when it is asked for: the distribution's, by the tags of git."""
    if name == "__version__":
        from importlib.metadata import version  # noqa: PLC0415  costs every start 10 ms

        return version("canshaper")
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
