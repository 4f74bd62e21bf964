"""Received messages: validity, sequence, age."""
