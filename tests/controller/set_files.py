"""The files of a machine with two loads and a choice of the operator."""

DBC = {
    "BO_ 512 SlewCommand": """BO_ 1296 Load: 4 PLANT
 SG_ Weight : 0|16@1+ (1,0) [0|5000] "kg" SHAPER

BO_ 1297 Choice: 1 PLANT
 SG_ Feel : 0|8@1+ (1,0) [0|255] "" SHAPER

BO_ 512 SlewCommand""",
    'BA_ "GenMsgCycleTime" BO_ 512 20;': (
        'BA_ "GenMsgCycleTime" BO_ 512 20;\nBA_ "GenMsgCycleTime" BO_ 1296 200;\n'
        'BA_ "GenMsgCycleTime" BO_ 1297 500;\nVAL_ 1296 Weight 65535 "NotAvailable" ;'
    ),
}
SETS = """
    gain_schedule:
      - breakpoint: 0
        sway: { period_s: 2.3, damping_ratio: 0.04, full_speed_m_s: 1.5 }
        filter: { kind: gff, a1: 0.7, a2: 0.12 }
      - breakpoint: 1000
        sway: { period_s: 2.9, damping_ratio: 0.05, full_speed_m_s: 1.5 }
        filter: { kind: gff, a1: 0.9, a2: 0.2 }
    profiles:
      fast: { filter: { kind: gff, a1: 0.5, a2: 0.06 } }
      calm: { filter: { kind: gff, a1: 1.2, a2: 0.3 } }"""
FAST = "fast: { filter: { kind: gff, a1: 0.5, a2: 0.06 } }"
# The profile with two loads of its own.
FAST_SETS = FAST[:-2] + (
    ", gain_schedule: ["
    "{ breakpoint: 0, sway: { period_s: 2.3, damping_ratio: 0.04, full_speed_m_s: 1.5 },"
    " filter: { kind: gff, a1: 0.5, a2: 0.06 } },"
    " { breakpoint: 1000, sway: { period_s: 2.9, damping_ratio: 0.05, full_speed_m_s: 1.5 },"
    " filter: { kind: gff, a1: 0.6, a2: 0.08 } }] }"
)
SLEW = "full_speed_m_s: 1.5 }\n    filter: { kind: gff, a1: 0.708, a2: 0.12 }"
YAML = {
    SLEW: SLEW + SETS,
    "status: { bus: crane, message: ShaperStatus }": (
        "status: { bus: crane, message: ShaperStatus }\n"
        "load_state: { bus: crane, message: Load, signal: Weight, timeout_ms: 500 }\n"
        "profile: { bus: crane, message: Choice, signal: Feel, timeout_ms: 1500,"
        " codes: { balanced: 0, fast: 1, calm: 2 } }"
    ),
}
