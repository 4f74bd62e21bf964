"""How much memory the page takes while it is driven.

nice python -m tests.studio.heap --minutes 26
"""

import argparse
import time

from tests.studio.browser import NoBrowserError, browser, opened
from tests.studio.conftest import Studio

SIZE = {"width": 1024, "height": 700}
STROKE_MS = 700


def main() -> None:
    """Drive, and print the heap every minute, what is garbage collected first."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0] if __doc__ else None)
    parser.add_argument("--minutes", type=float, default=10.0)
    minutes = parser.parse_args().minutes
    try:
        with browser() as one:
            studio, faults = Studio(), list[str]()
            try:
                page = opened(one, studio.url, faults, viewport=SIZE)
                protocol = page.context.new_cdp_session(page)
                begin_s = time.monotonic()
                for minute in range(int(minutes) + 1):
                    protocol.send("HeapProfiler.collectGarbage")
                    used = protocol.send("Runtime.getHeapUsage")["usedSize"]
                    nodes = page.evaluate("document.getElementsByTagName('*').length")
                    print(f"{minute:3} min {used / 1e6:6.1f} MB, {nodes} elements", flush=True)
                    while time.monotonic() - begin_s < 60.0 * (minute + 1) and minute < minutes:
                        for key in ("e", "a", "d"):
                            if key == "e" and page.inner_text("#seat") == "you drive":
                                continue
                            page.keyboard.down(key)
                            page.wait_for_timeout(STROKE_MS)
                            page.keyboard.up(key)
                            page.wait_for_timeout(2 * STROKE_MS)
                print(*faults, sep="\n")
            finally:
                studio.stop()
    except NoBrowserError as error:
        raise SystemExit(f"not measured: {error}") from None


if __name__ == "__main__":
    main()
