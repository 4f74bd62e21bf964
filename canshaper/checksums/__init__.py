"""Checksums of messages: every kind that a deployment may name, and how each is computed."""
