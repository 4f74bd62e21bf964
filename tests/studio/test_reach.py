"""Where other machines find the page."""

import os
import pty
import re
import signal
import socket
import subprocess
import sys
from http.cookiejar import CookieJar
from urllib.request import HTTPCookieProcessor, build_opener

import pytest

from canshaper.studio.access import qr_code, reachable
from tests.studio.conftest import ROOT
from tests.studio.page import WAIT_S


def test_all_addresses_are_named_by_one_of_this_machine() -> None:
    host = reachable("0.0.0.0")
    with socket.create_server((host, 0)) as one:  # it is one of ours
        assert one.getsockname()[1]
    assert host != "0.0.0.0"
    assert reachable("10.11.12.13") == "10.11.12.13"


@pytest.mark.slow
def test_what_is_printed_on_a_terminal_can_be_opened_and_is_a_qr_code() -> None:
    segno = pytest.importorskip("segno", reason="the extra studio is of an older checkout")
    master, slave = pty.openpty()
    command = [sys.executable, "-m", "canshaper", "studio", "forwarder.yaml", "--seed", "3"]
    command += ["--host", "0.0.0.0", "--port", "0"]
    with subprocess.Popen(command, cwd=ROOT, stdout=slave, stderr=subprocess.DEVNULL) as process:
        os.close(slave)
        text = ""
        while "▀▀▀▀▀" not in text and "segno" not in text:
            text += os.read(master, 65536).decode(errors="replace")
        try:
            match = re.search(r"open (http://\S+) in a browser", text.replace("\r\n", ""))
            assert match, text
            url = match[1]
            assert "0.0.0.0" not in url
            web = build_opener(HTTPCookieProcessor(CookieJar()))
            assert b"canshaper studio" in web.open(url, timeout=WAIT_S).read()
        finally:
            process.send_signal(signal.SIGINT)
            process.wait(WAIT_S)
            os.close(master)
    code = qr_code(url)
    assert code
    assert code.splitlines()[3] in text
    assert segno.make(url, error="l").designator  # as many letters as fit
