"""Traps in what a signal means, and in whether it can ever have the value that is waited for."""

from tests.machine.trap import J1939, Trap

ENABLE = 'VAL_ 272 Enable 0 "Off" 1 "On" 2 "Error" 3 "NotAvailable" ;'
SWITCHES = {"enable": "Enable", "reset": "Reset", "anti_sway_off": "AntiSwayOff"}
BIT = {"Enable": " 32|2@1+ (1,0) [0|1]", "AntiSwayOff": " 34|2@1+ (1,0) [0|1]"}
BIT["Reset"] = " 36|2@1+ (1,0) [0|1]"
STOP = "emergency_stop: { bus: crane, message: Safety, signal: Stop, timeout_ms: 200 }\n"
SEAT = "switches:\n  seat: { bus: crane, message: Safety, signal: Stop, timeout_ms: 200 }\n"
SAFETY = 'BO_ 896 Safety: 2 ECU\n SG_ Stop : 0|2@1+ (1,0) [0|3] "" SHAPER\n\nCM_ "Example'
CYCLE = 'BA_ "GenMsgCycleTime" BO_ 896 50;'
SLEW = ' SG_ Slew : 0|16@1- (0.1,0) [-100|100] "%" SHAPER'
VALVE = ' SG_ Velocity : 0|8@1- (0.8,0) [-100|100] "%" VALVES'
RADIUS = "radius: { bus: crane, message: TipPosition, signal: Radius, timeout_ms: 200 }"
MOTION = f"motion:\n  crane: {{ slew: slew, near_far: near_far, {RADIUS} }}\n"
SENSED = "sway_sensor: { bus: crane, message: GrappleSway, signal: SwayParallel, kind: angle,"
FEEL = "profile: { bus: crane, message: Safety, signal: Stop, timeout_ms: 500, codes: "
FAST = "    profiles: { fast: { filter: { kind: gff, a1: 0.5, a2: 0.06 } } }\n"
FLAGS = "flags: { neutral: XNeutral, negative: XNegative, positive: XPositive }"
DIRECTION = "{ signal: State, neutral: 0, positive: 1, negative: 2 }"


def table(name: str, words: str, *, message: int = 272, signal: str = "Enable") -> Trap:
    """A value table of a switch against its use."""
    zero, one = name.split("/")
    new = f'VAL_ {message} {signal} 0 "{zero}" 1 "{one}" ;'
    old = ENABLE.replace("272 Enable", f"{message} {signal}")
    return Trap(f"{message}.{signal} is {name}", words, dbc={old: new})


def stop(zero: str, one: str, signal: str = "Stop") -> Trap:
    """A value table of an emergency stop against its use."""
    values = f'VAL_ 896 Stop 0 "{zero}" 1 "{one}" ;' if zero else ""
    dbc = {'CM_ "Example': SAFETY, "": f"{CYCLE}\n{values}".replace("896 Stop", f"896 {signal}")}
    dbc = {k: v.replace("SG_ Stop", f"SG_ {signal}") for k, v in dbc.items()}
    yaml = {"axes:\n": STOP.replace("signal: Stop", f"signal: {signal}") + "axes:\n"}
    return Trap(f"stop {signal} {zero}/{one}", "would free the stop", yaml, dbc)


def seat(zero: str, one: str) -> Trap:
    """A switch whose default code is that of no agreement."""
    dbc = {'CM_ "Example': SAFETY, "": f'{CYCLE}\nVAL_ 896 Stop 0 "{zero}" 1 "{one}" ;'}
    yaml = {"axes:\n": SEAT + "axes:\n", "enable: Enable": "enable: [Enable, seat]"}
    return Trap(f"seat {zero}/{one}", "code: 0", yaml, dbc)


def bit(key: str, layout: str, words: str) -> Trap:
    """A switch that can never be what is waited for, or whose values the DBC has otherwise."""
    old = BIT[SWITCHES[key]]
    return Trap(f"{key} is {layout}", words, dbc={old: f"{old.partition('|')[0]}|{layout}"})


ENABLES = "would enable while"
TABLES = [
    table("Pressed/Released", ENABLES),
    table("On/Off", ENABLES),
    table("Active/Inactive", ENABLES),
    table("Gripped/Let go", ENABLES),
    table("Closed/Open", ENABLES),
    table("Pressed/Not pressed", ENABLES),
    table("Enabled/Disabled", ENABLES),
    table("Yes/No", ENABLES),
    table("True/False", ENABLES),
    table("gedrückt/losgelassen", ENABLES),
    table("Ein/Aus", ENABLES),
    table("x/Released", ENABLES),
    table("Operator present/y", ENABLES),
    table("Held/Not held", ENABLES),
    Trap("only its 0 has a name", ENABLES, dbc={ENABLE: 'VAL_ 272 Enable 0 "Pressed" ;'}),
    table("x/y", ENABLES),
    table("Released/Loose contact", ENABLES),
    table("Pressed/Released", ENABLES, message=273),
    table("Pressed/Released", "reset", signal="Reset"),
    table("Requested/Not requested", "anti_sway_off", signal="AntiSwayOff"),
    Trap(
        "the signal says whether anti-sway is on",
        "anti_sway_off",
        {"anti_sway_off: AntiSwayOff": "anti_sway_off: AntiSway"},
        {"SG_ AntiSwayOff": "SG_ AntiSway", "VAL_ 272 AntiSwayOff": "VAL_ 272 AntiSway"},
    ),
    Trap(
        "the signal is 1 while the grip is let go",
        ENABLES,
        {"enable: Enable": "enable: GripReleased"},
        {"SG_ Enable": "SG_ GripReleased", ENABLE: ""},
    ),
    Trap(
        "the signal is 1 while the crane is disabled",
        ENABLES,
        {"enable: Enable": "enable: CraneDisabled"},
        {"SG_ Enable": "SG_ CraneDisabled", ENABLE: ""},
    ),
    Trap(
        "the switch of another joystick is turned round",
        ENABLES,
        {"enable: Enable": "enable: [Enable, right.Enable]"},
        {ENABLE.replace("272", "273"): 'VAL_ 273 Enable 0 "Pressed" 1 "Released" ;'},
    ),
    stop("Stop", "Free"),
    stop("Pressed", "Released"),
    stop("Active", "Inactive"),
    stop("Emergency stop", "OK"),
    stop("Tripped", "x"),
    stop("x", "Normal"),
    stop("x", "y"),
    stop("Loose contact", "Pressed"),
    stop("Not closed", "Closed"),
    stop("", "", "EmergencyStopOk"),
    stop("", "", "StopReleased"),
    seat("Occupied", "Empty"),
    seat("Closed", "Open"),
    seat("Seated", "Not seated"),
    seat("Empty", "Loose contact"),
    Trap(
        "a flag is turned round",
        "flag",
        dbc={'XNeutral 0 "No" 1 "Yes"': 'XNeutral 0 "Yes" 1 "No"'},
        of=J1939,
    ),
    Trap(
        "neutral and positive are exchanged",
        "XPositive",
        {
            FLAGS: FLAGS.replace("XNeutral", "?")
            .replace("XPositive", "XNeutral")
            .replace("?", "XPositive")
        },
        of=J1939,
    ),
    Trap(
        "negative and positive flags are exchanged",
        "turned round",
        {
            FLAGS: FLAGS.replace("XNegative", "?")
            .replace("XPositive", "XNegative")
            .replace("?", "XPositive")
        },
        of=J1939,
        warns=True,
    ),
    *(
        Trap(f"direction {new}", words, {DIRECTION: new}, of=J1939)
        for new, words in (
            ("{ signal: State, neutral: 1, positive: 0, negative: 2 }", "Extend"),
            ("{ signal: State, neutral: 2, positive: 1, negative: 0 }", "Retract"),
            ("{ signal: State, neutral: 0, positive: 1, negative: 15 }", "DontCare"),
            ("{ signal: State, neutral: 15, positive: 1, negative: 2 }", "DontCare"),
        )
    ),
    Trap(
        "extend and retract are exchanged",
        "turned round",
        {DIRECTION: "{ signal: State, neutral: 0, positive: 2, negative: 1 }"},
        of=J1939,
        warns=True,
    ),
]

VALUES = [
    *(bit(key, "1@1- (1,0) [0|1]", "never be 1") for key in SWITCHES),
    *(bit(key, "2@1+ (1,0) [2|3]", "never be 1") for key in SWITCHES),
    *(
        bit(key, f"2@1+ {scale} [0|0]", "raw")
        for key in SWITCHES
        for scale in ("(-1,1)", "(1,1)", "(0,0)")
    ),
    Trap(
        "the stop is never free",
        "never be 0",
        {"axes:\n": STOP + "axes:\n"},
        {'CM_ "Example': SAFETY.replace("[0|3]", "[1|3]"), "": CYCLE},
    ),
    Trap(
        "the DBC turns the stop round",
        "raw",
        {"axes:\n": STOP + "axes:\n"},
        {'CM_ "Example': SAFETY.replace("(1,0) [0|3]", "(-1,1) [0|1]"), "": CYCLE},
    ),
    Trap(
        "a code out of its range never agrees",
        "never be 2",
        {
            "axes:\n": SEAT.replace("timeout", "code: 2, timeout") + "axes:\n",
            "enable: Enable": "enable: [Enable, seat]",
        },
        {'CM_ "Example': SAFETY.replace("[0|3]", "[0|1]"), "": CYCLE},
    ),
    *(
        Trap(f"{name} of the joystick", words, dbc={SLEW: SLEW.replace(old, new)})
        for name, old, new, words in (
            ("an infinite factor", "(0.1,0)", "(1e999,0)", "Slew"),
            ("no neutral", "0|16@1- (0.1,0)", "0|8@1- (20,10)", "neutral_pct"),
            ("no neutral by half a step", "0|16@1- (0.1,0)", "0|8@1- (5,2.5)", "neutral_pct"),
        )
    ),
    Trap("neutral is an error", "neutral", dbc={'Slew 32766 "Error"': 'Slew 0 "Invalid"'}),
    Trap("neutral is not available", "neutral", dbc={'Slew 32766 "Error"': 'Slew 0 "SNA"'}),
    Trap(
        "a band of neutral too small",
        "neutral_pct",
        {"Slew, neutral_pct: 2": "Slew, neutral_pct: 0.1"},
        {SLEW: SLEW.replace("0|16@1- (0.1,0)", "0|8@1- (0.8,0.4)")},
    ),
    *(
        Trap(f"a float of 16 bits, {signal}", "float", dbc={"": f"SIG_VALTYPE_ {of} {signal} : 1;"})
        for of, signal in ((272, "Slew"), (273, "Lift"))
    ),
    Trap(
        "a sway of 16 bits in floats",
        "float",
        {"    slewing:": f"    {SENSED} timeout_ms: 80 }}\n    slewing:"},
        {"": "SIG_VALTYPE_ 1024 SwayParallel : 1;"},
    ),
    Trap(
        "a radius of 16 bits in floats",
        "float",
        {"axes:\n": MOTION + "axes:\n"},
        {"": "SIG_VALTYPE_ 1025 Radius : 1;"},
    ),
    Trap(
        "a radius in mm",
        "expected a radius in m",
        {"axes:\n": MOTION + "axes:\n"},
        {'(0.001,0) [0|60] "m"': '(1,0) [0|60000] ""'},
    ),
    Trap(
        "a radius in cm",
        "expected a radius in m",
        {"axes:\n": MOTION + "axes:\n"},
        {'(0.001,0) [0|60] "m"': '(1,0) [0|2500] ""'},
    ),
    Trap(
        "a profile that no value chooses",
        "never be 9",
        {"axes:\n": FEEL + "{ fast: 9 } }\naxes:\n", "    slewing:": FAST + "    slewing:"},
        {'CM_ "Example': SAFETY, "": CYCLE},
    ),
    Trap(
        "a profile between two values",
        "never be 1",
        {"axes:\n": FEEL + "{ fast: 1 } }\naxes:\n", "    slewing:": FAST + "    slewing:"},
        {'CM_ "Example': SAFETY.replace("(1,0)", "(2,0)"), "": CYCLE},
    ),
    Trap(
        "two profiles by one value",
        "fast",
        {
            "axes:\n": FEEL + "{ fast: 1, calm: 1 } }\naxes:\n",
            "    slewing:": FAST + "    slewing:",
        },
        {'CM_ "Example': SAFETY, "": CYCLE},
    ),
    *(
        Trap(
            f"full: {full} of the joystick",
            words,
            {"signal: Slew, neutral": f"signal: Slew, full: {full}, neutral"},
            warns=warns,
        )
        for full, words, warns in (
            (0.5, "steps", False),
            (0.9, "steps", False),
            (10, "of its range", True),
            (3, "of its range", True),
        )
    ),
    Trap(
        "full of three steps of a magnitude",
        "steps",
        {"signal: XPosition\n": "signal: XPosition\n      full: 0.3\n"},
        of=J1939,
    ),
]
TRAPS = [*TABLES, *VALUES]
