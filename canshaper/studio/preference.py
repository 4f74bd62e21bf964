"""The slider from quicker to calmer: settings of each filter that has several, with their measures.

For G_FF the settings lie along the front of ``tune --preference``; for a robust shaper they are
responses of other lengths; all through the limits and within the stopping distance of the file. The
range ends where a response is shorter than half a swing, where the filter is useless, and where the
grapple would hang still earlier without it. ``python -m canshaper.studio.preference FILE`` prints
the settings as JSON, which takes seconds: so it runs apart from the cranes of the page.
"""

import json
import math
import os
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from canshaper.config.filters import Filter, filter_of
from canshaper.config.schema import AxisSection, DeploymentConfig
from canshaper.design.tuning.evaluate import evaluate
from canshaper.design.tuning.formulation import MOST_DAMPED
from canshaper.design.tuning.verdict import USELESS, on_axis
from canshaper.edit.edit import replace_text
from canshaper.errors import CanshaperError
from canshaper.machine.binding import load_deployment
from canshaper.machine.deployment import Deployment

PREFERENCE = "preference"
AS_IN_FILE = -1.0
"""Position of the slider at which each filter is that of the file; the others are 0 to 1."""
NICE = 10  # the cranes of the live page go first
_STEPS = 11
# Responses of a robust shaper, in swings.
_SHORTEST, _LONGEST = 0.5, 1.3
_LENGTHS_PCT = (-10, 0, 10)

Setting = dict[str, Any]
"""Filter section and ``tail_s`` of an axis; ``left``, a part of the swing, at worst within 10 % of
the length; ``run_on_m`` and ``still_s``, from full speed until it hangs still (None: never)."""


def offered(config: DeploymentConfig) -> list[str]:
    """Return the axes with lightly damped sway and a single G_FF or robust filter of one mode."""
    return [name for name, axis in config.axes.items() if _has_settings(axis)]


def _has_settings(axis: AxisSection) -> bool:
    several, design = axis.gain_schedule or axis.profiles, axis.filter.design()
    if several or axis.sway is None or axis.sway.mode().damping_ratio > MOST_DAMPED:
        return False
    return axis.filter.kind in ("gff", "robust") and not (design and design.second)


def settings(deployment: Deployment, axis: str) -> dict[str, Any]:
    """Return the setting of the ``file``, and those to ``choose`` from, quickest first; maybe none.

    A longer robust response that leaves more is left out: ``stop_distance_m`` cuts it off.
    """
    config = deployment.axes[axis].config
    made = _front if config.filter.kind == "gff" else _responses
    own = _measured(deployment, axis, config.filter, config.limits.tail_s)[0]
    found = (_fitting(deployment, axis, *one) for one in made(deployment, axis))
    choose: list[Setting] = []
    for one in filter(None, found):
        if config.filter.kind == "gff" or all(one["left"] <= other["left"] for other in choose):
            choose.append(one)
    return {"file": own, "choose": choose}


def _front(deployment: Deployment, axis: str) -> Iterator[tuple[Filter, float]]:
    from canshaper.commissioning.tuned import design_tuned  # noqa: PLC0415  # takes its time
    from canshaper.design.tuning import preference  # noqa: PLC0415

    front = design_tuned(deployment, axis, {PREFERENCE: 0.5}).choices
    steps = [preference.chosen(front, k / (_STEPS - 1)).poles_rad_s for k in range(_STEPS)]
    for first, second, *third in dict.fromkeys(steps):
        poles = [round(first, 4), round(second, 4)]
        last = {"third_pole_rad_s": round(third[0], 4)} if third else {}
        yield (
            filter_of("gff", poles_rad_s=poles, **last),
            deployment.axes[axis].config.limits.tail_s,
        )


def _responses(deployment: Deployment, axis: str) -> Iterator[tuple[Filter, float]]:
    from canshaper.commissioning.robust import design_robust  # noqa: PLC0415  # takes its time

    config = deployment.axes[axis].config
    assert config.sway is not None
    period_s, design = config.sway.mode().period_s, config.filter.design()
    range_pct = (design.length_range_pct if design else None) or 15.0
    for k in range(_STEPS):
        swings = _SHORTEST + (_LONGEST - _SHORTEST) * k / (_STEPS - 1)
        try:
            one = design_robust(deployment, axis, range_pct=range_pct, duration_s=swings * period_s)
        except CanshaperError:
            continue  # the valve takes longer than such a response
        yield one.chosen, one.needed_s or config.limits.tail_s


def _fitting(deployment: Deployment, axis: str, chosen: Filter, tail_s: float) -> Setting | None:
    """Return the setting; None if useless, under half a swing, or still later than unfiltered."""
    config = deployment.axes[axis].config
    assert config.sway is not None
    setting, run_on_s, raw_s = _measured(deployment, axis, chosen, tail_s)
    design = chosen.design()
    length_s = (design.duration_s if design else None) or run_on_s
    still_s = math.inf if setting["still_s"] is None else setting["still_s"]
    quick = length_s < 0.999 * _SHORTEST * config.sway.mode().period_s  # a tick of rounding
    return None if quick or setting["left"] > USELESS or still_s > raw_s else setting


def _measured(
    deployment: Deployment, axis: str, chosen: Filter, tail_s: float
) -> tuple[Setting, float, float]:
    """Return the setting, its run-on to 5 % in s, and ``still_s`` without the filter."""
    sway = deployment.axes[axis].config.sway
    assert sway is not None
    setup = on_axis(deployment, axis, chosen, tail_s=tail_s)
    mode, measures = setup[0], evaluate(*setup, _LENGTHS_PCT)
    left = measures.worst()
    swing_deg = math.degrees(sway.full_speed_m_s * mode.angle_per_speed_rad / mode.omega_rad_s)

    def still_s(part: float) -> float:
        """Return the time in s until this part of the raw swing has decayed to stillness."""
        times = part * swing_deg / deployment.config.still_deg
        decay_per_s = -mode.pole.real
        if times <= 1.0:
            return 0.0
        return math.log(times) / decay_per_s if decay_per_s else math.inf

    after_s = max(min(measures.run_on_s, tail_s), still_s(left))
    return (
        {
            "filter": chosen.model_dump(exclude_none=True),
            "tail_s": tail_s,
            "left": round(left, 4),
            "run_on_m": round(measures.mean_delay_s * sway.full_speed_m_s, 3),
            "still_s": round(after_s, 2) if math.isfinite(after_s) else None,
        },
        measures.run_on_s,
        still_s(1.0),
    )


class Preference:
    """The slider of a page from quicker to calmer.

    Args:
        path: the copy, in JSON, of the deployment file; the daemon of the page runs it.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._file = path.read_text("utf-8")
        self._lock = threading.Lock()
        self._started = self._stopped = False
        self._process: subprocess.Popen[str] | None = None
        self._found: dict[str, Any] | None = None

    def found(self) -> dict[str, Any]:
        """Return ``settings`` by axis; the first call takes seconds. Empty if it failed."""
        with self._lock:
            if self._found is None:
                command = [sys.executable, "-m", "canshaper.studio.preference", str(self._path)]
                with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
                    self._process = process
                    if self._stopped:
                        process.kill()
                    text = process.communicate()[0]
                self._found = json.loads(text) if process.returncode == 0 else {}
            return self._found

    def ready(self) -> dict[str, Any] | None:
        """Return ``settings`` by axis; None while a thread of the first call computes them."""
        if not self._started:
            self._started = True
            threading.Thread(target=self.found, daemon=True).start()
        return self._found

    def stop(self) -> None:
        """End the process that computes the settings, also one that is about to start."""
        self._stopped = True
        if self._process:
            self._process.kill()
            self._process.wait()

    def write(self, position: float) -> Deployment:
        """Write the settings at a position of the slider into the copy, and return it loaded.

        It waits for ``found``; ``AS_IN_FILE`` restores the filters of the file.

        Raises:
            ValueError: the position is not on the slider.
            ConfigError: no valid deployment, or it cannot be written; the copy is unchanged.
        """
        if not (position == AS_IN_FILE or 0.0 <= position <= 1.0):
            raise ValueError(f"slider {PREFERENCE}: expected 0 to 1, got {str(position)[:20]}")
        data = json.loads(self._file)
        found = self.found() if position != AS_IN_FILE else {}
        for axis, choose in ((name, one["choose"]) for name, one in found.items()):
            if choose:
                setting = choose[round(position * (len(choose) - 1))]
                data["axes"][axis]["filter"] = setting["filter"]
                data["axes"][axis].setdefault("limits", {})["tail_s"] = setting["tail_s"]
        replace_text(self._path, json.dumps(data, indent=1))
        return load_deployment(self._path)


def main() -> None:
    """Print ``settings`` by axis, as JSON, of the file that is the first argument."""
    os.nice(NICE)
    deployment = load_deployment(Path(sys.argv[1]))
    print(json.dumps({axis: settings(deployment, axis) for axis in offered(deployment.config)}))


if __name__ == "__main__":
    main()
