"""Signals on CAN: DBC binding, codecs and buses."""
