"""Protocols on top of CAN, each in a folder of its own."""
