"""A check that the keys of locks can be had."""

from __future__ import annotations

from collections.abc import Mapping

from veca_marl.sim.physics.props import Prop


def check_keys(props: Mapping[str, Prop]) -> None:
    """Check that the key of each lock is a prop that can be carried to it.

    Args:
        props: All props of a world by name.

    Raises:
        ValueError: If a key is no prop, or a fixed one; the message lists the loose props.
    """
    for name, prop in props.items():
        lock = None if prop.cfg.joint is None else prop.cfg.joint.lock
        if lock is None or not lock.key:
            continue
        key = props.get(lock.key)
        if key is None or key.fixed:
            fault = "is no prop" if key is None else "is a fixed prop"
            loose = sorted(
                each for each, one in props.items() if not one.fixed and one.joint is None
            )
            raise ValueError(
                f"prop {name!r}: the key {lock.key!r} of its lock {fault}; choose one of the loose "
                f"props {loose}, or an empty name for a lock that no prop opens"
            )
