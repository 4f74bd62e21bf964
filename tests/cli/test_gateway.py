"""The verb of the gateway without SocketCAN, and what the check reports about a gateway."""

from pathlib import Path

import pytest

from canshaper.errors import GatewayError
from canshaper.protocols.gateway import cangw
from canshaper.protocols.gateway.cangw import Rule, difference
from canshaper.protocols.gateway.forwarding import Pattern
from tests.cli.invocation import invoke
from tests.rigs.files import ROOT, machine_file

FILE = ROOT / "config" / "gateway-forwarder.yaml"


def test_a_file_without_a_gateway_has_no_rules() -> None:
    result = invoke("gateway", str(ROOT / "config" / "forwarder.yaml"), "running")
    assert result.exit_code == 2
    assert "expected a section gateway, got none" in result.stderr


def test_a_kernel_that_refuses_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    def refuse() -> list[Rule]:
        raise GatewayError("rules of can-gw cannot be listed: no")

    monkeypatch.setattr(cangw, "rules", refuse)
    result = invoke("gateway", str(FILE))
    assert result.exit_code == 3
    assert result.stderr == "rules of can-gw cannot be listed: no\n"


@pytest.mark.parametrize(
    ("fallback", "message"),
    [("stop", "no joystick does"), ("neutral", "neutral joysticks do"), ("pass", "WARNING: ")],
)
def test_the_check_reports_what_passes(tmp_path: Path, fallback: str, message: str) -> None:
    file = machine_file(tmp_path, FILE, ("fallback: neutral", f"fallback: {fallback}"))
    result = invoke("check", str(file))
    assert result.exit_code == 0
    line = "gateway between joysticks and machine: others pass by the kernel, "
    assert f"{line}{message}" in result.stdout


def test_the_same_rule_twice_is_one_too_many() -> None:
    """It would pass every frame twice."""
    one, other = (Rule("a", "b", Pattern(i, 0x7FF)) for i in (1, 2))
    assert difference([one, one, other], [one]) == ([one, other], [])
    assert difference([one], [one, one]) == ([], [one])
