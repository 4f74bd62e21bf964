"""A machine whose numbers may be changed while it runs."""

CONTROL = """
control:
  adjustable:
    axes.slew.sway.period_s: [1.8, 3.0]
    axes.slew.sway.full_speed_m_s: [1, 3]
    axes.slew.filter.a1: [0.3, 1.0]
    axes.slew.filter.a2: [0.03, 0.2]
    axes.slew.limits.max_pct: [20, 100]
    axes.slew.limits.rise_per_s: [1, 5]
    axes.near_far.sway.length_m: [0.5, 2.0]
    axes.lift.limits.max_pct: [20, 100]
"""
STATUS = "status: { bus: crane, message: ShaperStatus }\n"
