import pytest
from listening import make_receiver

from veca_marl.fidelity.hearing.doppler import approaching_source, theory_hz


@pytest.mark.parametrize("quality", ["mono", "hrtf"])
def test_direct_sound_and_reflection_have_their_own_doppler_shift(quality):
    """The image source of an approaching source recedes."""
    direct, reflection = approaching_source(3.0, 2000.0, make_receiver(quality))
    assert direct.frequency_hz == pytest.approx(theory_hz(3.0, 2000.0), abs=1.0)
    assert reflection.frequency_hz == pytest.approx(theory_hz(-3.0, 2000.0), abs=1.0)
    assert max(direct.ripple_db, reflection.ripple_db) < 1.0


def test_a_source_at_rest_is_not_shifted():
    direct, reflection = approaching_source(0.0, 1000.0, make_receiver("mono"))
    assert direct.frequency_hz == pytest.approx(1000.0, abs=0.01)
    assert reflection.frequency_hz == pytest.approx(1000.0, abs=0.01)
