"""Filters, one file for each family: functions or classes, and a row for each kind."""
