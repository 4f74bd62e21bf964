"""``canshaper`` and ``python -m canshaper``."""

import gc
import sys


def main() -> None:
    """Run the command; Ctrl-C while its modules are loaded ends it as later."""
    if sys.argv[1:2] == ["run"]:
        gc.disable()  # what is loaded stays; the daemon's `Collector` has the rest
    try:
        from canshaper.cli.app import main as run  # noqa: PLC0415  (what may be interrupted)

        run()
    except KeyboardInterrupt:
        sys.exit(130)
    finally:
        gc.freeze()  # else Python's end looks through all that was loaded, for up to seconds


if __name__ == "__main__":
    main()
