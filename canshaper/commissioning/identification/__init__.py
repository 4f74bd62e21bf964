"""Natural period, damping and full speed of the swing from logs, a phone or a stopwatch.

canlog: signals and commands of CAN logs, J1939 too. table: CSV of phones and loggers, with broken
lines. data: direction of a phone's swing, stopwatch, labels. series: units; when who was commanded.
segments, swing: free swings that no one has marked. decay: period and damping with intervals that
hold the truth. driven: full speed, and a crane that never hangs still. verdict: refusals with what
to do, a second swing. report, plot: lines, JSON, advice for several loads, picture.
"""
