"""Natural period, damping and full speed of the swing from logs, a phone or a stopwatch.

What each part is for:

- canlog: signals and commands of CAN logs by DBC, with buses, J1939 addresses, codes and merits.
- table: tables of phones and loggers, with their delimiters, units, clocks and broken lines.
- data: the direction of a phone's swing, the stopwatch, labels of loads; logs to findings.
- series: units, stretches and gaps; when which axis was commanded.
- segments, swing: free swings in a log that no one has marked, also without commands.
- decay: period and damping of free swings with intervals that hold the truth.
- driven: the full speed, and the swing of a crane that never hangs still.
- verdict: refusals with what to do; a second swing.
- report, plot: lines, JSON, advice for one load or several, the picture.
"""
