"""A recorded drive, replayed through the controller: the same frames to the last bit.

``drive.log`` is what came in: both joysticks and the tip's place, as ``candump -L`` writes it.
``forwarder.log`` and ``forwarder-robust.log`` are what the controller sends at every tick of it.
Both are lines of text, so a change of behaviour is read in a diff.

The filters compute with floats, and another mathematical library may round the last bit of ``exp``
or ``sin`` otherwise. What is sent is rounded to the grid of its frame, so that shows only where a
value lies next to a rounding edge, half-way between two steps. The nearest comes to 0.0005 steps of
it with forwarder.yaml, 0.0011 with forwarder-robust.yaml. Six and three lie exactly on it: the rate
limit, 0.1 a tick, leads to 77.5 and 39.5 steps with sums and products alone, which every machine
rounds alike. ``python -m tests.golden`` measures this again; ``test_replay.py`` replays with a
library that is wrong by 1e-9, millions of last bits, and the frames stay the same.
"""
