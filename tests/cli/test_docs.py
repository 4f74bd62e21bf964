"""``canshaper docs``: a built site is served on this machine only; else a line says where it is."""

import signal
import socket
import subprocess
import sys
from pathlib import Path
from urllib.error import HTTPError
from urllib.request import urlopen

import pytest
from typer.testing import CliRunner

from canshaper.cli.app import app
from canshaper.cli.verbs import docs as verb


@pytest.fixture
def site(tmp_path: Path) -> Path:
    """A site of two files."""
    (tmp_path / "index.html").write_text("<h1>pages</h1>")
    (tmp_path / "machine.yaml").write_text("version: 1\n")
    return tmp_path


# A shell's background job has Ctrl-C ignored.
SERVE = """
import signal
import sys
from pathlib import Path
from canshaper.cli.app import main
from canshaper.cli.verbs import docs

signal.signal(signal.SIGINT, signal.default_int_handler)
site = Path(sys.argv.pop())
docs.site_directory = lambda: site
main()
"""


@pytest.mark.processes
def test_it_serves_the_pages_until_ctrl_c(site: Path) -> None:
    command = [sys.executable, "-uc", SERVE, "docs", "--port", "0", str(site)]
    with subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True
    ) as process:
        try:
            assert process.stdout is not None
            url = process.stdout.readline().split()[1]
            assert url.startswith("http://127.0.0.1:")
            assert process.stdout.readline() == f"the same as files: {site / 'index.html'}\n"
            with urlopen(url) as page:
                assert page.read() == b"<h1>pages</h1>"
            with urlopen(f"{url}machine.yaml") as file:
                assert file.headers["Content-Type"] == "text/plain"
            with pytest.raises(HTTPError, match="404") as absent:
                urlopen(f"{url}../{site.name}/index.html")
            absent.value.close()
            process.send_signal(signal.SIGINT)
            _, errors = process.communicate()
        finally:
            process.kill()
    assert (process.returncode, errors) == (130, "interrupted\n")


def test_without_a_site_it_says_where_the_pages_are(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(verb, "site_directory", lambda: None)
    done = CliRunner().invoke(app, ["docs"])
    pages = Path(verb.__file__).parents[3] / "docs"
    assert done.exit_code == 2
    assert f"read {pages}, or run make docs" in done.output


def test_a_port_that_is_in_use_is_an_error(site: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(verb, "site_directory", lambda: site)
    with socket.create_server(("127.0.0.1", 0)) as other:
        done = CliRunner().invoke(app, ["docs", "--port", str(other.getsockname()[1])])
    assert done.exit_code == 1
    assert "Address already in use; try --port 0" in done.output
