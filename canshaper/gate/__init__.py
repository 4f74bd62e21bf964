"""The gate: every valve frame leaves through it, and by no other way.

If the gate is right, no line of the program that computes a frame can break promises 1 to 5 of
docs/safety.md: no motion without an operator; neutral stops; never faster than asked, nor against
the joystick; every frame is one of its tick; one wrong command reaches no valve. Promise 6, that
each fault has a name and a way back, is the controller's. A frame that the gate passes leaves by a
port of ``bus``, which changes no byte; tests/gate/test_senders.py names every line that calls one.

The gate knows nothing of how a frame was made. It decodes the frames of joysticks, switches and
emergency stop for itself, remembers what it needs of them, and checks every byte of every frame
that is to leave, in every tick: it caches no verdict. A refused frame is replaced by a neutral one,
with a reason in the log, or by none where the neutral one is refused too.

    build.py     makes the record, once, from the numbers of the file
    signals.py   for the record: converts signals, as cantools has loaded them
    record.py    the record: identifiers, bits, limits
    fields.py    converts bits to numbers and velocities
    checks.py    checksums, AUTOSAR E2E
    received.py  messages, switches, joysticks: are they whole, in sequence, fresh?
    axis.py      an axis: whether it is armed, what was asked of it, what left for its valve
    rules.py     the ten rules, each a function of what was received, what left before, and now
    gate.py      receives frames, begins ticks, judges frames that are to leave; reloads
    cycle.py     the clock, a loop at its deadlines, its tick; after a standstill nothing leaves

An axis is *armed* when its joystick was seen in neutral, valid and enabled, since the last reason
to stop. After a soft reason (rule 2) the axis has ``stop_s`` in which it may fall; after a hard one
(rule 1) it has none, and the reason latches if the axis moved: then neutral counts only after reset
or enable was pressed again. A reason to stop counts in every frame, however briefly it was there; a
reason to go on counts only when the axis has its turn.

    1  stop at once    enable or another switch off, emergency stop, second sender, failed send,
                       loop that stood still, decoders that disagree, a frame refused before
    2  stop shaped     silence, counter that stands or jumps, error code, contradiction, frozen
    3  neutral first   nothing moves that is not armed, but for its shaped stop
    4  direction, size no faster than asked within the tail, than ``max_pct``, than may be added
    5  rise, 6 fall    by the rates of the file; a fall to neutral passes, and ends armed
    7  distance        no farther than was asked and not yet run; path and time of what is added
    8  bytes           length, every bit that is not ours, signals that agree, checksum
    9  turn            one frame in the tick in which it is due, with the next alive counter
    10 identifiers     nothing that the file does not send

The gate allows all that the controller may do. Its memory reaches as far back as the controller's
or farther: if it forgot sooner, it would refuse a sound frame. It cannot know nodes of CANopen,
checksums of other packages, and whether a velocity slower than asked is right.
"""
