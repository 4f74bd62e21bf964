"""The least that Python can do: a joystick frame comes back as a valve frame, unread.

echo.py CHANNEL
"""

import socket
import struct
import sys

port = socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW)
port.setsockopt(socket.SOL_CAN_RAW, socket.CAN_RAW_FILTER, struct.pack("=II", 0x110, 0xC00007FF))
port.bind((sys.argv[1],))
print("ready", flush=True)
while True:
    frame = port.recv(16)
    port.send(b"\x00\x02\x00\x00" + frame[4:])
