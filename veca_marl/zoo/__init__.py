"""Policies that have learnt already: ``veca_marl.zoo.load("KickTheBall")``.

Commands take them as ``zoo/NAME``: ``play policy=zoo/KickTheBall``, ``evaluate policy=zoo/...``,
``opponent.red=zoo/...``, ``init_from.TEAM=zoo/...``. ``python -m veca_marl.zoo list`` lists them.
"""

from veca_marl.zoo.entries import Entry, Policy, entries, load

__all__ = ["Entry", "Policy", "entries", "load"]
