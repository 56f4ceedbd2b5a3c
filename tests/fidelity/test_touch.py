"""The laws of deep contact, for a part of the cases of the page."""

import numpy as np

from veca_marl.fidelity.touch.approaches import all_approaches, extremes


def test_readings_never_fall_on_the_way_to_the_bone_and_are_one_there():
    """Shapes from 3 mm on, several skins, paths and tilts; the readings fell to 0 at the bone."""
    approaches = list(all_approaches(np.random.default_rng(0), (0.5, 1.0, 2.0)))[::23]
    found = extremes(approaches, 60)
    assert found.count > 150
    assert found.largest_fall < 1e-4
    assert found.least_at_bone > 0.999
