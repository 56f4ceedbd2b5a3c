"""Messages about workers that do not answer."""

import pytest

from veca_marl.algos.collection.answers import no_answer


@pytest.mark.parametrize(
    ("silent", "message"),
    [
        ([1], "worker process 1 (of 0 to 2) did not answer for 2 s "),
        ([0, 2], "worker processes 0 and 2 (of 0 to 2) did not answer for 2 s "),
    ],
)
def test_the_message_agrees_in_number(silent, message):
    found = no_answer("worker process", silent, 3, 2.0)
    assert found.startswith(message)
    assert found.endswith("was killed" if len(silent) == 1 else "were killed")
