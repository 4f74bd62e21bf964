"""Sockets: raw SocketCAN, python-can, netlink; a bus as a device; arrivals."""
