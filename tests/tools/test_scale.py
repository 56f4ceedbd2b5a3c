"""Arithmetic of the page about many cores, and its text from made-up figures."""

import pytest
from composed import compose

from tools.scale import Cost, Measured, on_paper, page


def test_collection_learning_and_receiving_take_turns():
    two = on_paper(worlds_ms=2.0, receive_ms=0.0, learn_ms=2.0, cores=2)
    assert (two.collected, two.learnt) == pytest.approx((1000.0, 500.0))
    many = on_paper(worlds_ms=2.0, receive_ms=0.1, learn_ms=2.0, cores=10**9)
    assert many.free == pytest.approx(10_000.0)
    assert many.learnt == pytest.approx(1e3 / 1.1)


def test_more_than_one_machine_is_computed_from_actors():
    measured = Measured(
        parts_ms={"physics": 1.0, "vision": 3.0},
        collection={
            "the learner's process": Cost(2.0, 2.0, 2.0),
            "2 worker processes": Cost(2.0, 0.0001, 1.0),
            "2 actors of Ray": Cost(3.0, 1.0, 1.0),
        },
        learning=Cost(1.0, 1.0, 1.0),
        frame_bytes=1000.0,
        policy_bytes=512_000,
        cfg=compose(["+task=KickTheBall"]),
        batches=1,
        machine="one",
    )
    text = page(measured, [100, 1000])
    (row,) = (line for line in text.splitlines() if line.startswith("| 1000 |"))
    assert "| 998 |" in row  # an actor's worlds take 2 ms, and receiving a frame 1 ms
    assert "| 2,000 |" in text  # bytes of a frame with those of its parameters, for 512 frames
