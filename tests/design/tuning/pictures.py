"""Picture of what each weight of ``canshaper tune`` does, for docs/tuning.md.

python -m tests.design.tuning.pictures docs
"""

import argparse
import math
from pathlib import Path

from canshaper.commissioning.tuned import design_tuned
from canshaper.design.tuning.evaluate import Machine, Traces, gff, press
from canshaper.machine.binding import load_deployment
from canshaper.report.style import RAW_COLOUR, TEXT_COLOUR, new_figure, plain, save, titled
from tests.rigs.files import ROOT

FILE, AXIS = ROOT / "config" / "forwarder.yaml", "near_far"
# Weights as the table of the page raises them, and which other one is off.
ROWS = {
    "q": ("--q: swing", (1.0, 10.0, 100.0), {}),
    "p": ("--p: change", (1.0, 100.0, 2000.0), {}),
    "r": ("--r: distance from 95 %", (0.01, 0.1, 10.0), {"s": 0.0}),
    "s": ("--s: distance from command", (0.01, 0.1, 10.0), {"r": 0.0}),
}
COLOURS = ("#9CC9E8", "#4292C6", "#08306B")  # light: the smallest weight
SHOWN_S = 6.0


def traced(weight: str, value: float, others: dict[str, float]) -> Traces:
    """A full press through the machine with the poles that this weight gives."""
    deployment = load_deployment(FILE)
    given = {weight: [value] if weight == "q" else value, **others}
    one = design_tuned(deployment, AXIS, given, starts=1)
    shaper = gff(one.setting.poles_rad_s, one.setting.third_pole_rad_s)
    return press(one.task.mode, one.task.tick_s, shaper, Machine.of(one.bound), SHOWN_S)


def draw(path: Path) -> None:
    """Draw speed and swing after a full press, a column for each weight."""
    sway = load_deployment(FILE).axes[AXIS].config.sway
    assert sway is not None
    to_deg = math.degrees(sway.mode().angle_per_speed_rad * sway.full_speed_m_s)
    fig = new_figure(1600, 620)
    grid = fig.add_gridspec(
        2, len(ROWS), left=0.045, right=0.99, top=0.93, bottom=0.09, wspace=0.08, hspace=0.1
    )
    for column, (weight, (title, values, others)) in enumerate(ROWS.items()):
        speed = fig.add_subplot(grid[0, column])
        swing = fig.add_subplot(grid[1, column], sharex=speed)
        without = " " + " ".join(f"(--{name} 0)" for name in others) if others else ""
        for panel in (speed, swing):
            plain(panel)
            panel.set_xlim(0.0, SHOWN_S)
        titled(speed, title + without, 12)
        for value, colour in zip(values, COLOURS, strict=True):
            one = traced(weight, value, others)
            if value == values[0]:
                raw = [to_deg * angle for angle in one.swing_raw]
                swing.plot(one.t_s, raw, color=RAW_COLOUR, linewidth=1.0, label="without filter")
            sent = [100.0 * v for v in one.sent]
            speed.plot(one.t_s, sent, color=colour, linewidth=2.2, label=f"{value:g}")
            swing.plot(one.t_s, [to_deg * v for v in one.swing], color=colour, linewidth=2.2)
        speed.set_ylim(-5.0, 112.0)
        swing.set_ylim(-1.2 * max(raw), 1.2 * max(raw))
        speed.tick_params(labelbottom=False)
        speed.legend(loc="lower right", frameon=False, fontsize=11)
        if column:
            speed.tick_params(labelleft=False)
            swing.tick_params(labelleft=False)
        else:
            speed.set_ylabel("sent to the valve, % of full", fontsize=11, color=TEXT_COLOUR)
            swing.set_ylabel("swing, degrees", fontsize=11, color=TEXT_COLOUR)
            swing.legend(loc="lower right", frameon=False, fontsize=11)
        swing.set_xlabel("time after a full press, s", fontsize=11, color=TEXT_COLOUR)
    save(fig, path)


def main() -> None:
    """Draw it."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0] if __doc__ else None)
    parser.add_argument("directory", type=Path)
    draw(parser.parse_args().directory / "weights.png")


if __name__ == "__main__":
    main()
