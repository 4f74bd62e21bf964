"""The judge notices small changes of the C, most of them by the inner state alone."""

import shutil
from pathlib import Path

import pytest

from canshaper.native.library import C_FILES
from tests.native.judge import difference, native
from tests.rigs.files import CONFIG, read

# File, what stands there, what stands there instead, and what shows it first.
MUTANTS = {
    "a sum that is rounded as it grows": (
        "cs_math.c",
        "if (small != 0) {",
        "if (0 * small != 0) {",
        "unlimited",
    ),
    "a sum that is rounded twice": ("cs_math.c", "high = next;", "high = high;", "unlimited"),
    "no correction of the root": ("cs_math.c", "if (largest > 0)", "if (largest > 9)", "angle"),
    "another carry": ("cs_output.c", "MOST_CARRY CS_R(0.1)", "MOST_CARRY CS_R(0.2)", "carry"),
    "what is added counts as run-on": (
        "cs_output.c",
        "asked) - c->largest_added)",
        "asked) - 0)",
        "ran",
    ),
    "run-on that is not summed": ("cs_output.c", "    a->ran = ", "    a->ran = 0 * ", "ran"),
    "missed ticks of a reversal": (
        "cs_output.c",
        "a->crossed = cs_later(a->crossed, ticks);",
        "",
        "crossed",
    ),
    "a way that is not looked at": (
        "cs_output.c",
        "no_run_on = end_run_on(a, c, demand) || no_run_on;",
        "no_run_on = no_run_on || end_run_on(a, c, demand);",
        "side",
    ),
    "missed ticks of the tail": (
        "cs_limits.c",
        "(a->aged || ((leaving == e->high)",
        "(((leaving == e->high)",
        "demanded_high",
    ),
    "a demand that leaves late": ("cs_limits.c", "oldest != e->high", "false", "commanded"),
    "a fall that ends at zero": ("cs_limits.c", "(from > c->fall)", "(from >= c->fall)", "ramp"),
    "a switch that is lost was pressed": (
        "cs_states.c",
        "a->was_enabled = in->enabled || unknown;",
        "a->was_enabled = in->enabled;",
        "was_enabled",
    ),
    "a stop that begins old": (
        "cs_states.c",
        "if (a->state == CS_STOPPING) { a->stopping = 0; }",
        "",
        "stopping",
    ),
    "unattended a tick too soon": (
        "cs_axis.c",
        "UNATTENDED_TICKS 3",
        "UNATTENDED_TICKS 2",
        "unattended",
    ),
    "a stroke that a stop leaves small": (
        "cs_axis.c",
        "if (a->state != CS_ACTIVE) { a->left = -CS_INFINITY; }",
        "",
        "left",
    ),
    "one missed tick for all": ("cs_axis.c", "i < MOST_HELD", "i < 1", "angle"),
    "a counter that never begins again": (
        "cs_input.c",
        "bool jump = (step > c->max_step) && !m->resynced;",
        "bool jump = (step > c->max_step);",
        "rested",
    ),
    "another fade": ("cs_motion.c", "FADE_S CS_R(0.2)", "FADE_S CS_R(0.25)", "part 3, 0"),
    "another join": ("cs_motion.c", "joins = !over;", "joins = over;", "part 3, 6"),
    "an overrun without an end": (
        "canshaper.c",
        "s->overrun = (s->overrun || (s->late == LATE_LIMIT)) && (s->late > 0);",
        "s->overrun = s->late == LATE_LIMIT;",
        "was_reset",
    ),
    "a foreign sender": ("canshaper.c", "FOREIGN_NS 1000000000", "FOREIGN_NS 900000000", "state"),
}
TICKS = 2_000


@pytest.mark.parametrize("name", MUTANTS)
def test_a_small_change_is_noticed(name: str, tmp_path: Path) -> None:
    file, old, new, shows = MUTANTS[name]
    sources = tmp_path / "c"
    shutil.copytree(C_FILES, sources)
    path = sources / "src" / file
    text = path.read_text(encoding="ascii")
    assert text.count(old) == 1, old
    path.write_text(text.replace(old, new))
    deployment = read(CONFIG / "forwarder-robust.yaml")
    c = native(deployment, "-O0", sources=sources)
    wrong, _ = difference(deployment, c, "first", TICKS)
    assert shows in wrong, wrong


def test_the_c_as_it_is_has_no_difference_there() -> None:
    deployment = read(CONFIG / "forwarder-robust.yaml")
    assert difference(deployment, native(deployment, "-O0"), "first", TICKS)[0] == ""
