"""Names under which verbs are registered."""

import subprocess
import sys

import pytest
from refusals import naming

from veca_marl.sim.physics.interactions import INTERACTIONS, Interaction, register_interaction


@pytest.mark.parametrize("given", [5, None, "", "none", "has space", "2nd", "push-over", ["push"]])
def test_a_verb_whose_name_is_no_identifier_is_refused(given):
    class Push(Interaction):
        name = given

    before = dict(INTERACTIONS)
    with pytest.raises(ValueError, match=naming(f"Push.name={given!r}")):
        register_interaction(Push)
    assert dict(INTERACTIONS) == before


def test_an_identifier_is_accepted(monkeypatch):
    monkeypatch.setattr(INTERACTIONS, "_entries", dict(INTERACTIONS))

    class Push(Interaction):
        name = "push_over2"

    assert register_interaction(Push) is Push
    assert INTERACTIONS["push_over2"] is Push


@pytest.mark.slow
def test_the_verbs_are_known_in_a_world_without_bodies():
    """In a process that imports no body, as programs may do that use the physics without one."""
    program = (
        "import sys\n"
        "from veca_marl.sim.physics.interactions import check_interactions\n"
        "check_interactions('prop', ['grab', 'kick', 'step_on', 'put_into'])\n"
        "assert 'veca_marl.sim.body' not in sys.modules\n"
    )
    subprocess.run([sys.executable, "-c", program], check=True)
