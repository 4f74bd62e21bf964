"""Export of frames and ticks in any format, and the options of the verbs."""

import json
import os
import sys
from collections import defaultdict
from collections.abc import Sequence
from pathlib import Path
from xml.etree import ElementTree

import pytest

from canshaper.cli.common import loader
from canshaper.codec.frame import Frame
from canshaper.design.lockstep import drive
from canshaper.machine.binding import load_deployment
from canshaper.recording.export import Export, exporting
from canshaper.recording.form import Group, Point, Row
from canshaper.recording.listen import ReceivedFrame
from canshaper.recording.replay import Replay, look
from canshaper.recording.ticks import Result, Tick
from canshaper_sim.crane import CraneParameters
from canshaper_sim.operator import script_named
from tests.cli.invocation import invoke
from tests.golden.replay import CONFIG, DRIVE
from tests.recording.lines import error_of

MULTIPLEXED = """
BO_ 1536 Oil: 4 PLANT
 SG_ Page M : 0|8@1+ (1,0) [0|3] "" PLANT
 SG_ Pressure m0 : 8|16@1+ (0.1,0) [0|6000] "bar" PLANT
 SG_ Warm m1 : 8|8@1- (0.5,20) [-40|80] "degC" PLANT
"""


class Kept:
    """A file in memory."""

    def __init__(self) -> None:
        self.frames: list[tuple[ReceivedFrame, bool]] = []
        self.groups: dict[str, Group] = {}
        self.rows: dict[str, list[tuple[int, list[float]]]] = defaultdict(list)
        self.events: list[str] = []
        self.poses: list[tuple[int, Sequence[Point], Point]] = []

    def frame(self, frame: ReceivedFrame, *, sent: bool = False) -> None:
        self.frames.append((frame, sent))

    def group(self, group: Group) -> Row:
        self.groups[group.name] = group
        return lambda time_ns, values: self.rows[group.name].append((time_ns, [*values]))

    def event(self, time_ns: int, text: str) -> None:
        self.events.append(text)

    def pose(self, time_ns: int, boom: Sequence[Point], grapple: Point) -> None:
        self.poses.append((time_ns, boom, grapple))

    def close(self) -> None:
        pass


def kept(file: str | Path = CONFIG / "forwarder-robust.yaml") -> tuple[Kept, Export]:
    file_in_memory = Kept()
    export = Export(file_in_memory, load_deployment(Path(file)), CraneParameters())
    return file_in_memory, export


def rounded(points: Sequence[Sequence[float]]) -> tuple[float, ...]:
    return tuple(round(one, 6) for point in points for one in point)


def test_a_simulated_drive_tells_states_and_pose_by_its_frames() -> None:
    file, export = kept()
    deployment = load_deployment(CONFIG / "forwarder-robust.yaml")
    script = script_named("pulse-slew", [*deployment.axes])
    recording = drive(deployment, script, None, export.seen)
    commands = [row[0] for _, row in file.rows["axes/slew"]]
    assert max(commands) == pytest.approx(max(recording.axes["slew"].joystick), abs=0.01)
    assert "axis=slew state=ACTIVE from=READY reason=JOYSTICK_MOVED" in file.events
    assert file.groups["signals/crane/GrappleSway"].channels[0].unit == "deg"
    assert recording.crane is not None
    drawn = [(boom[-1][:2], grapple[:2]) for _, boom, grapple in file.poses]
    measured = zip(recording.crane.tip_m, recording.crane.grapple_m, strict=True)
    both = {rounded(pair) for pair in drawn} & {rounded(pair) for pair in measured}
    assert len(both) > len({rounded(pair) for pair in drawn}) // 2
    gaps = [b[0] - a[0] for a, b in zip(file.poses, file.poses[1:], strict=False)]
    assert min(gaps) >= 40_000_000


def test_messages_with_pages_are_a_group_each_and_short_frames_have_no_values(
    tmp_path: Path,
) -> None:
    text = (CONFIG / "forwarder.yaml").read_text()
    dbc = tmp_path / "forwarder.dbc"
    dbc.write_text((CONFIG.parent / "dbc" / "forwarder.dbc").read_text() + MULTIPLEXED)
    (tmp_path / "a.yaml").write_text(text.replace("../dbc/forwarder.dbc", str(dbc)))
    file, export = kept(tmp_path / "a.yaml")
    for time_ns, content in enumerate(("00640000", "01140000", "00c80000", "00")):
        export.frame(ReceivedFrame(time_ns, "crane", "", 0x600, False, bytes.fromhex(content), ""))
    assert file.rows["signals/crane/Oil/Page0"] == [(0, [0, 10.0]), (2, [0, 20.0])]
    assert file.rows["signals/crane/Oil/Page1"] == [(1, [1, 30.0])]
    assert [c.unit for c in file.groups["signals/crane/Oil/Page1"].channels] == ["", "degC"]
    assert len(file.frames) == 4


def test_codes_have_names_and_measurements_with_named_errors_have_not() -> None:
    file, export = kept()
    export.seen(Frame("crane", 272, False, bytes(8)), 0.0)
    texts = {c.name: c.texts for c in file.groups["signals/crane/JoystickLeft"].channels}
    assert texts["Enable"] == {0: "Off", 1: "On", 2: "Error", 3: "NotAvailable"}
    assert texts["Slew"] is None


def test_a_j1939_message_counts_from_any_address() -> None:
    file, export = kept(CONFIG / "j1939-forwarder.yaml")
    deployment = load_deployment(CONFIG / "j1939-forwarder.yaml")
    (joystick, *_) = deployment.joysticks.values()
    bus, can_id, _ = joystick.key
    name = joystick.message.name
    for source in (0x21, 0x7E):
        export.seen(Frame(bus, can_id & ~0xFF | source, True, bytes(8)), 0.0)
    assert len(file.rows[f"signals/{bus}/{name}"]) == 2


def test_what_is_no_data_frame_is_written_and_not_decoded() -> None:
    file, export = kept()
    one = ReceivedFrame(7, "crane", "", 272, False, b"", "remote")
    export.frame(one)
    export.frame(one._replace(can_id=0x7FF, kind=""))
    assert [frame.kind for frame, _ in file.frames] == ["remote", ""]
    assert not any(file.rows.values())


def test_a_machine_that_no_simulated_crane_has_is_exported_without_pose() -> None:
    deployment = loader("two-cranes.yaml")()
    file = Kept()
    export = Export(file, deployment, CraneParameters())
    export.tick(Tick(0, 0), Result([], {}, []))
    assert not file.poses
    assert len(file.groups) == len(deployment.axes) + 1


# -- verbs -------------------------------------------------------------------------------------


@pytest.mark.slow
def test_demo_and_replay_export_what_replay_and_others_read(tmp_path: Path) -> None:
    drive, again = tmp_path / "drive.mcap", tmp_path / "again.mcap"
    demo = ["demo", "--seed", "3", "--export", str(drive), "--out", str(tmp_path / "demo")]
    assert invoke(*demo).exit_code == 0
    replay = ["replay", str(drive), "--config", "forwarder-robust.yaml", "--export", str(again)]
    result = invoke(*replay, "--out", tmp_path / "out")
    assert result.exit_code == 0, result.output
    deployment = load_deployment(CONFIG / "forwarder-robust.yaml")
    two = [
        [r.sent for _, r in Replay(deployment, look(deployment, p, {}, own=False)).run(print)]
        for p in (drive, again)
    ]
    assert two[0] == two[1]


@pytest.mark.parametrize(
    ("options", "text"),
    [
        (["--export", "a.csv"], "--export: expected a file with .mcap or .mf4, got a.csv"),
        (
            ["--config", "forwarder.yaml", "--export", "a.mcap"],
            "--export: expected one --config, got 2",
        ),
        (["--export", "none/a.mcap"], "none/a.mcap: No such file or directory"),
    ],
)
def test_wrong_exports_are_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, options: list[str], text: str
) -> None:
    monkeypatch.chdir(tmp_path)
    call = ["replay", str(DRIVE), "--config", "forwarder-robust.yaml", *options]
    result = invoke(*call)
    assert (result.exit_code, result.stderr.strip()) == (2, text)


@pytest.mark.parametrize(("suffix", "module"), [("mcap", "mcap.writer"), ("mf4", "asammdf")])
def test_a_missing_extra_is_one_line(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, suffix: str, module: str
) -> None:
    for name in ("mcap_write", "mf4_write"):
        monkeypatch.delitem(sys.modules, f"canshaper.recording.{name}", raising=False)
    monkeypatch.setitem(sys.modules, module, None)
    path = tmp_path / f"a.{suffix}"
    with (
        pytest.raises(ValueError, match=rf"a\.{suffix}: needs {module}, which is missing: pip"),
        exporting(path, load_deployment(CONFIG / "forwarder.yaml")),
    ):
        pass
    assert not path.exists()


@pytest.mark.parametrize(
    ("code", "text"),
    [
        ("import os; os.abort()", "expected an MF4 log that is whole, got one at which asammdf cr"),
        ("raise ModuleNotFoundError(name='lxml')", "MF4 logs need lxml, which is missing: pip"),
        ("class MDF:\n def __init__(self, _): 1 / 0", "got ZeroDivisionError division by zero"),
    ],
)
def test_what_ends_asammdf_does_not_end_us(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, code: str, text: str
) -> None:
    (tmp_path / "asammdf.py").write_text(code)
    monkeypatch.setenv("PYTHONPATH", str(tmp_path), prepend=os.pathsep)
    (tmp_path / "a.mf4").write_bytes(b"MDF     4.10")
    assert text in error_of(tmp_path / "a.mf4")


# -- layouts -----------------------------------------------------------------------------------


def test_shipped_layouts_name_what_is_exported() -> None:
    file, _ = kept()
    layouts = CONFIG / "layouts"
    foxglove = json.loads((layouts / "foxglove.json").read_text())
    panels = foxglove["configById"]
    text = json.dumps(foxglove["layout"])
    assert all(name in text for name in panels)
    paths = [one["value"] for panel in panels.values() for one in panel.get("paths", ())]
    curves = ElementTree.parse(layouts / "plotjuggler.xml").iter("curve")
    names = [curve.attrib["name"].rpartition("/") for curve in curves]
    named = [path.rpartition(".") for path in paths] + names
    assert len(names) > 3
    for topic, _, channel in named:
        assert channel in {one.name for one in file.groups[topic[1:]].channels}, topic
