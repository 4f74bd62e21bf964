"""The package over its life: upgrade, removal, purge. What is the administrator's stays."""

from pathlib import Path

from tests.hil.machine import VALVES, candump, logged, message_name
from tests.systemd.packages import CHANGE, CHANGED, NEXT, NEXT_VERSION, install, path
from tests.systemd.unit import DROP_IN, Unit, run

ETC = Path("/etc/canshaper")
OWN = "# changed by the administrator\n"
WANTS = Path("/etc/systemd/system/multi-user.target.wants")


def version() -> str:
    return run("dpkg-query", "--show", "--showformat=${Version}", "canshaper").stdout


def test_upgrade_restarts_what_runs_and_keeps_the_administrators_files(forwarder: Unit) -> None:
    updated, kept = (ETC / name for name in CHANGED)
    kept.write_text(kept.read_text() + OWN)
    forwarder.file.write_text(forwarder.file.read_text() + OWN)
    own = Unit("own")
    own.file.write_text(forwarder.file.read_text().replace("vcan0", "vcan1"))
    stopped = Unit("forwarder-robust")
    stopped.systemctl("enable")
    pid = forwarder.show("MainPID")

    install(path(NEXT))

    assert version() == NEXT_VERSION
    assert forwarder.show("ActiveState") == "active"
    assert forwarder.show("MainPID") != pid
    assert [stopped.show("ActiveState"), own.show("ActiveState")] == ["inactive", "inactive"]
    assert stopped.systemctl("is-enabled") == "enabled"
    assert own.systemctl("is-enabled", status=1) == "disabled"
    assert updated.read_text().endswith(CHANGE)
    for file in (forwarder.file, own.file, kept):
        assert file.read_text().endswith(OWN)
    assert Path(f"{kept}.dpkg-dist").read_text().endswith(CHANGE)
    assert DROP_IN.exists()


def test_removal_stops_and_purge_leaves_only_what_the_administrator_made(
    forwarder: Unit, tmp_path: Path
) -> None:
    shipped = [Path(line) for line in run("dpkg", "--listfiles", "canshaper").stdout.splitlines()]
    own = Unit("own")
    own.file.write_text(forwarder.file.read_text().replace("vcan0", "vcan1"))
    with candump(tmp_path / "end.log", "vcan0"):
        done = run("dpkg", "--no-triggers", "--remove", "canshaper")
    assert done.returncode == 0, done.stderr
    last = {message_name(m): m.data[0] for m in logged(tmp_path / "end.log")}
    assert {name: last[name] for name in VALVES} == dict.fromkeys(VALVES, 0)
    assert forwarder.show("LoadState") == "not-found"
    assert forwarder.file.exists()  # configuration stays until purge
    assert (WANTS / forwarder.name).is_symlink()

    DROP_IN.unlink()
    DROP_IN.parent.rmdir()
    done = run("dpkg", "--no-triggers", "--purge", "canshaper")
    assert done.returncode == 0, done.stderr
    assert list(ETC.rglob("*")) == [own.file]
    assert [p for p in shipped if not p.is_dir() and p.exists()] == []
    assert [p for p in shipped if p.is_dir() and "canshaper" in p.parts and p != ETC] == []
    assert list(Path("/etc/systemd").rglob("*canshaper*")) == []
    assert list(Path("/var/lib").glob("*/*canshaper*")) == []
    assert run("getent", "passwd", "canshaper").stdout == ""
    assert run("systemctl", "list-units", "--all", "--no-legend", "canshaper@*").stdout == ""
