"""Names under which verbs are registered."""

import pytest

from veca_marl.sim.physics.interactions import INTERACTIONS, Interaction, register_interaction


@pytest.mark.parametrize("given", [5, None, "", "none", "has space", "2nd", "push-over", ["push"]])
def test_a_verb_whose_name_is_no_identifier_is_refused(given):
    class Push(Interaction):
        name = given

    before = dict(INTERACTIONS)
    with pytest.raises(ValueError, match=r"Push.name=.* must name the verb by an identifier"):
        register_interaction(Push)
    assert dict(INTERACTIONS) == before


def test_an_identifier_is_accepted(monkeypatch):
    monkeypatch.setattr(INTERACTIONS, "_entries", dict(INTERACTIONS))

    class Push(Interaction):
        name = "push_over2"

    assert register_interaction(Push) is Push
    assert INTERACTIONS["push_over2"] is Push
