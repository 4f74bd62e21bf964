"""Run inside of the image: the live page and the docs answer on a port of their own."""

import re
import subprocess
import urllib.request

for verb, text in (("studio", b"canshaper"), ("docs", b"From a new machine to a calm grapple")):
    with subprocess.Popen(
        ["canshaper", verb, "--port", "0"], stdout=subprocess.PIPE, text=True
    ) as process:
        try:
            assert process.stdout is not None
            line = process.stdout.readline()
            match = re.search(r"http://\S+", line)
            assert match, line
            page = "docs/guide.html" if verb == "docs" else ""
            with urllib.request.urlopen(match[0] + page) as answer:
                assert text in answer.read(), verb
        finally:
            process.terminate()
