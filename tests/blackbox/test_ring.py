"""The ring in memory: how much it keeps, what is held, and when a state is kept."""

import tracemalloc
from dataclasses import replace

import pytest

from canshaper.blackbox import keeper, ring
from canshaper.blackbox.ring import BLOCK, RECORD, Kind, Ring, records
from canshaper.controller.controller import Controller
from canshaper.controller.gated import GatedController
from canshaper.machine.binding import load_deployment
from tests.daemon.bench import Bench


def filled(ring_: Ring, count: int, first: int = 0) -> None:
    for number in range(first, first + count):
        ring_.put(Kind.RX, 0, 8, False, number, 10 * number, b"12345678")


def test_the_ring_takes_no_more_than_it_may(monkeypatch: pytest.MonkeyPatch) -> None:
    a_block = BLOCK // RECORD.size
    one = Ring(most_blocks=4)
    filled(one, 3)  # nowhere: nothing has begun
    assert one.segments == ()
    for number in range(20):
        one.begin(b"%d" % number, number * 10**9, follows=True)
        filled(one, a_block * 3 // 2, number)
        blocks = {id(block) for segment in one.segments for block in segment.blocks}
        assert len(blocks) <= 4
    last, newest = one.segments[-2:]
    assert [last.state, newest.state] == [b"18", b"19"]
    read = [record.number for record in records(newest.data())]
    assert read == list(range(19, 19 + a_block * 3 // 2))


def test_what_is_more_than_all_of_it_is_cut_off() -> None:
    a_block = BLOCK // RECORD.size
    one = Ring(most_blocks=2)
    one.begin(b"", 0, follows=True)
    filled(one, 5 * a_block)
    (segment,) = one.segments
    assert segment.cut_off
    assert len(segment.data()) == 2 * BLOCK
    one.begin(b"", 10**9, follows=True)
    filled(one, 3)
    assert not one.segments[-1].follows
    assert [r.number for r in records(one.segments[-1].data())] == [0, 1, 2]


def test_what_is_held_is_not_written_over() -> None:
    a_block = BLOCK // RECORD.size
    one = Ring(most_blocks=2)
    one.begin(b"", 0, follows=True)
    filled(one, a_block)
    (held,) = one.segments
    held.held = True
    before = held.data()
    for number in range(4):
        one.begin(b"", (100 + number) * 10**9, follows=True)
        filled(one, a_block, 10**6)
    assert held.data() == before
    assert held not in one.segments


def test_a_steady_ring_takes_no_more_memory() -> None:
    one = Ring(most_blocks=3)
    one.begin(b"", 0, follows=True)
    filled(one, 3 * BLOCK // RECORD.size)
    one.begin(b"", 100 * 10**9, follows=True)
    tracemalloc.start()
    try:
        before = tracemalloc.get_traced_memory()[0]
        filled(one, 2000)
        assert tracemalloc.get_traced_memory()[0] - before < 2000
    finally:
        tracemalloc.stop()
    assert ring.KEPT_NS == 60 * 10**9


@pytest.mark.parametrize(("tick_ms", "states"), [(20, 10), (2, 1)])
def test_a_short_tick_keeps_a_state_only_while_nothing_moves(
    bench: Bench, monkeypatch: pytest.MonkeyPatch, tick_ms: int, states: int
) -> None:
    monkeypatch.setattr(keeper, "STATE_NS", 10**9)
    deployment = load_deployment(bench.file)
    config = deployment.config.model_copy(update={"tick_ms": tick_ms})
    deployment = replace(deployment, config=config)
    black_box = keeper.BlackBox(None)
    controller = Controller(deployment)
    black_box.around(GatedController(controller), controller)
    black_box.begin(0)
    for tick in range(1, 500):
        black_box.after_tick(tick * 20_000_000, (), neutral=False)
    assert len(black_box._ring.segments) == states
    black_box.after_tick(10**10, (), neutral=True)
    assert len(black_box._ring.segments) == states + 1
