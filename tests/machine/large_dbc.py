"""The shipped DBC file with thousands of messages more, as a machine's whole bus has them."""

from tests.rigs.files import ROOT

SHIPPED = (ROOT / "dbc" / "forwarder.dbc").read_text(encoding="cp1252")
ATTRIBUTES = 'BA_ "GenMsgCycleTime"'


def large(count: int) -> str:
    """Text with so many messages before those of the shipped file, a kilobyte each."""
    head, rest = SHIPPED.split("BO_ ", 1)
    messages, tail = ("BO_ " + rest).split("CM_ ", 1)
    first, second = [head], [messages, "CM_ " + tail]
    for i in range(count):
        number = 0x8CF00000 + i
        first.append(f"BO_ {number} Other{i}: 8 PLANT\n")
        for byte in range(8):
            place = f"{8 * byte}|8@1+ (0.4,0) [0|100]"
            first.append(f' SG_ Signal{byte} : {place} "%" SHAPER,VALVES\n')
        first.append("\n")
        second.append(f'CM_ BO_ {number} "Values that another node sends to all the others.";\n')
        second.append(f"{ATTRIBUTES} BO_ {number} 100;\n")
        for byte in range(4):
            second.append(f'CM_ SG_ {number} Signal{byte} "What the value means, in a line.";\n')
            second.append(f'VAL_ {number} Signal{byte} 254 "error" 255 "not available" ;\n')
    return "".join(first + second)
