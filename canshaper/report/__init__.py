"""Measures, tables and pictures of recorded drives."""
