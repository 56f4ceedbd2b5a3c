"""Free fall, sliding and rolling against theory."""

import pytest

from tools.fidelity.mechanics.rigid_bodies import SUBSTEPS, laws


@pytest.mark.parametrize("substeps", [SUBSTEPS[0], SUBSTEPS[-1]])
def test_a_rigid_body_falls_slides_and_rolls_as_theory_says(substeps):
    broken = [law for law in laws(substeps) if not law.holds]
    assert not broken
