"""Crane and swing of a recorded drive."""

from canshaper_sim.recording import CraneTrace, Recording


def crane_of(recording: Recording) -> CraneTrace:
    """The crane, which this drive has to have."""
    assert recording.crane is not None
    return recording.crane


def swing_from(recording: Recording, from_s: float) -> float:
    """Largest swing from this time on, degrees."""
    swing = zip(recording.t_s, crane_of(recording).sway_deg, strict=True)
    return max(deg for time_s, deg in swing if time_s >= from_s)


def last_swing(recording: Recording, last_s: float = 3.0) -> float:
    """Largest swing in the last seconds, of 50 samples each, degrees."""
    return max(crane_of(recording).sway_deg[-round(50.0 * last_s) :])
