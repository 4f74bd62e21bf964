"""Messages of DBC files as plain cantools reads them."""

from pathlib import Path
from typing import Any

import cantools


def parts(message: Any) -> list[Any]:
    """All of a message that anything here reads."""
    keys = ("name", "frame_id", "is_extended_frame", "length", "cycle_time", "comment", "protocol")
    of_signal = (
        *("name", "start", "length", "byte_order", "is_signed", "is_float", "scale", "offset"),
        *("minimum", "maximum", "unit", "raw_initial", "comment", "receivers", "spn"),
        *("is_multiplexer", "multiplexer_ids", "multiplexer_signal"),
    )
    values: list[Any] = [getattr(message, key) for key in (*keys, "senders", "send_type")]
    values += [[(group.name, group.signal_names) for group in message.signal_groups or []]]
    for signal in message.signals:
        choices = {raw: str(name) for raw, name in (signal.choices or {}).items()}
        values.append([choices, *(getattr(signal, key) for key in of_signal)])
    return values


def whole(path: Path) -> Any:
    return cantools.database.load_file(path, encoding="cp1252")


OTHER = 'BO_ 5 Other: 2 A\n SG_ One : 0|8@1+ (1,0) [0|0] "" A\n SG_ Two : 8|8@1+ (1,0) [0|0] "" A\n'
