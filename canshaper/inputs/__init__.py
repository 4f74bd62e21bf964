"""Checked inputs: validity, sequence and age of each received message."""
