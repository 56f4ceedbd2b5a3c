"""Touch: deep contact, small objects anywhere on the body, two-point resolution."""

from veca_marl.fidelity.touch.laws import section

__all__ = ["section"]
