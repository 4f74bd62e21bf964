"""Traps in whole messages and files: ids, senders, buses, names, speeds."""

from tests.machine.trap import J1939, Trap

ADDRESS, FREE = 0x9C, 0xFE
OWN = {
    "DM1": 0x18FECA00 | ADDRESS,
    "acknowledge": 0x18E8FF00 | ADDRESS,
    "transport": 0x1CECFF00 | ADDRESS,
    "data of transport": 0x1CEBFF00 | ADDRESS,
    "claim": 0x18EEFF00 | ADDRESS,
    "no address": 0x18EEFF00 | FREE,
    "request": 0x18EAFF00 | FREE,
}
EXTENDED = 1 << 31
DIGEST = ' SG_ Digest : 0|16@1+ (1,0) [0|65535] "" PLANT\n\n'
IDENTITY = "identity: { bus: crane, message: ShaperIdentity }"
SECOND = 'VERSION ""\nNS_ :\nBS_:\nBU_: A\n'
J1939PG = 'BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","reserved","J1939PG";\n'
CYCLES = 'BA_DEF_ BO_ "GenMsgCycleTime" INT 0 65535;\n'
SENDER = "BO_ 512 SlewCommand: 2 SHAPER"
SWAY = "full_speed_m_s: 1.5"
SLEWING = "full_speed_rad_s: 0.5, largest_radius_m: 9.6"
CONTROL = (
    "control: {{ mode: '{}', adjustable: {{ axes.slew.limits.max_pct: [20, 100] }} }}\naxes:\n"
)
CRANE = "  crane: { interface: socketcan, channel: vcan0, bitrate: 250000 }\n"
SEATED = "{ bus: crane, message: Safety, signal: Seated, timeout_ms: 200 }"
SAFETY = 'BO_ 896 Safety: 2 ECU\n SG_ Seated : 0|2@1+ (1,0) [0|3] "" SHAPER\n\nCM_ "Example'
COUNT = ' SG_ AliveCounter : 8|8@1+ (1,0) [0|255] "" VALVES\n'
FINE = ' SG_ Fine : {}|16@1- (0.01,0) [-100|100] "%" VALVES\n'


def message(can_id: int, name: str, *, j1939: bool, text: str, cycle: int = 1000) -> str:
    """A DBC file of one message of 29 bits."""
    number = can_id | EXTENDED
    kind = f'BA_ "VFrameFormat" BO_ {number} {3 if j1939 else 1};\n'
    return f"{SECOND}\nBO_ {number} {name}: 8 SHAPER\n{text}\n{J1939PG}{CYCLES}{kind}" + (
        f'BA_ "GenMsgCycleTime" BO_ {number} {cycle};\n'
    )


def sent(name: str, can_id: int, *, j1939: bool) -> Trap:
    """An identity message with the id of something that our node of J1939 sends."""
    extra = message(can_id, "Ours", j1939=j1939, text=DIGEST)
    yaml = {IDENTITY: IDENTITY.replace("ShaperIdentity", "Ours")}
    kind = "a group of J1939" if j1939 else "an id of 29 bits"
    return Trap(f"identity is {name}, {kind}", "our node", yaml, of=J1939, extra=extra)


def received(name: str, can_id: int, *, j1939: bool) -> Trap:
    """A switch that comes with the id of something that our node of J1939 sends."""
    text = ' SG_ Seated : 0|2@1+ (1,0) [0|1] "" SHAPER\n\n'
    extra = message(can_id, "Seat", j1939=j1939, text=text, cycle=50)
    seat = (
        "switches:\n  seat: { bus: crane, message: Seat, signal: Seated, timeout_ms: 200 }\naxes:\n"
    )
    yaml = {"axes:\n": seat, "enable: Button1": "enable: [Button1, seat]"}
    kind = "a group of J1939" if j1939 else "an id of 29 bits"
    return Trap(f"a switch is {name}, {kind}", "our node", yaml, of=J1939, extra=extra)


IDS = [
    *(sent(name, can_id, j1939=j) for name, can_id in OWN.items() for j in (False, True)),
    *(received(name, can_id, j1939=False) for name, can_id in OWN.items()),
    *(
        received(name, OWN[name] & ~0xFF | 0x33, j1939=True)
        for name in ("claim", "transport", "data of transport", "acknowledge")
    ),
    Trap(
        "an identity of 29 bits has the id of a valve of J1939",
        "axes.slew.valve",
        {IDENTITY: IDENTITY.replace("ShaperIdentity", "Ours")},
        of=J1939,
        extra=message(0x0CFE309C, "Ours", j1939=False, text=DIGEST),
    ),
    Trap(
        "an identity of 29 bits has the id of a joystick of J1939",
        "joysticks.left",
        {
            IDENTITY: IDENTITY.replace("ShaperIdentity", "Ours"),
            "message: BJM1\n": "message: BJM1\n    source: 0x33\n",
        },
        of=J1939,
        extra=message(0x0CFDD633, "Ours", j1939=False, text=DIGEST),
    ),
    Trap(
        "two joysticks of one group, one from any address",
        "any source",
        {"message: BJM2\n": "message: Other\n    source: 0x34\n"},
        {
            "BO_ 2365446398 BJM2": "BO_ 2365445684 Other",
            "BO_ 2365446398 3;": "BO_ 2365445684 3;",
            "BO_ 2365446398 20;": "BO_ 2365445684 20;",
        },
        of=J1939,
    ),
    *(
        Trap(
            f"another DBC file has the id {can_id} for something else",
            f"id {can_id:#x} of {name}",
            extra=f'{SECOND}\nBO_ {can_id} Extra: 8 A\n SG_ X : 0|8@1+ (1,0) [0|1] "" A\n',
            warns=True,
        )
        for can_id, name in ((272, "JoystickLeft"), (512, "SlewCommand"), (784, "ShaperStatus"))
    ),
]

MACHINES = [
    *(
        Trap(
            f"the valve's command is sent by {node}",
            f"is sent by {node}",
            dbc={SENDER: SENDER.replace("SHAPER", node)},
            warns=True,
        )
        for node in ("JOYSTICKS", "VALVES", "PLANT")
    ),
    *(
        Trap(
            f"one signal of a joystick moves two axes, {new}", "also moves", {old: new}, warns=True
        )
        for old, new in (
            ("signal: NearFar,", "signal: Slew,"),
            ("joystick: right, signal: Lift,", "joystick: left, signal: NearFar,"),
        )
    ),
    *(
        Trap(
            f"another resolution is left at 0, {at}",
            "also: [Fine]",
            dbc={
                SENDER: SENDER.replace(": 2", f": {size}"),
                f"{COUNT}\nBO_ 513": COUNT + FINE.format(at) + "\nBO_ 513",
            },
            warns=True,
        )
        for at, size in ((16, 4), (32, 8))
    ),
    Trap(
        "a valve's eight bits are left at 0",
        "also: [PortFlow]",
        {"      also: [PortFlow] # for valves that know the eight bits only\n": ""},
        of=J1939,
        warns=True,
    ),
    *(
        Trap(
            f"the tip is {new} next to the slewing",
            "measure both",
            {SWAY: f"full_speed_m_s: {new}"},
            warns=True,
        )
        for new in (0.05, 0.2, 6.0, 9.9)
    ),
    *(
        Trap(f"slewing at {new}", "measure both", {SLEWING: new}, warns=True)
        for new in (
            "full_speed_rad_s: 0.05, largest_radius_m: 9.6",
            "full_speed_rad_s: 0.1, largest_radius_m: 9.6",
            "full_speed_rad_s: 3, largest_radius_m: 9.6",
        )
    ),
    Trap(
        "near-far is 30 times slower than slew",
        "times",
        {"full_speed_m_s: 1.0": "full_speed_m_s: 0.05"},
        warns=True,
    ),
    Trap(
        "near-far is 15 times faster than slew",
        "times",
        {"full_speed_m_s: 1.0": "full_speed_m_s: 20"},
        warns=True,
    ),
    Trap(
        "the grapple is farther out than the boom is long",
        "largest_radius_m",
        {"axes:\n": "motion:\n  crane: { slew: slew, near_far: near_far, radius_m: 12 }\naxes:\n"},
    ),
    *(
        Trap(f"a socket of mode {mode}", "others", {"axes:\n": CONTROL.format(mode)})
        for mode in ("0666", "0777", "0602", "0662", "0606")
    ),
    *(
        Trap(
            f"two buses by one name, {name}",
            "bus crane",
            {CRANE: CRANE + CRANE.replace("crane", name).replace("vcan0", "vcan1")},
        )
        for name in ("Crane", "CRANE", "'crane '")
    ),
    Trap(
        "two joysticks by one name",
        "joystick left",
        {"  right:\n": "  Left:\n", "joystick: right": "joystick: Left"},
    ),
    Trap("two axes by one name", "axis slew", {"  lift:\n": "  Slew:\n"}),
    Trap(
        "a switch has the name of a signal of the joystick",
        "of JoystickLeft and one of switches",
        {"axes:\n": f"switches:\n  Enable: {SEATED}\naxes:\n"},
        {
            'CM_ "Example': SAFETY,
            "": 'BA_ "GenMsgCycleTime" BO_ 896 50;',
        },
    ),
]
TRAPS = [*IDS, *MACHINES]
