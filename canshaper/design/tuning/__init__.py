"""Tuning on the desk: the optimal tuner (Eq. 14-15), the manual rule, measures of a setting.

Needs the ``tools`` extra; nothing of it is imported by the daemon.
"""
