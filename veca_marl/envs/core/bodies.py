"""The bodies with which a task can be played."""

from __future__ import annotations

from collections.abc import Sequence

from veca_marl.sim.body import BodyCfg
from veca_marl.sim.body.humanoid import HumanoidCfg
from veca_marl.sim.body.walker import WalkerCfg

_KINDS: dict[type[BodyCfg], str] = {
    WalkerCfg: "a body that walks; choose body=walker",
    HumanoidCfg: "a body with joints; choose body=full, mitten, full_limbs or mitten_limbs",
}


def check_body(owner: str, body: BodyCfg, needed: type[BodyCfg], verbs: Sequence[str] = ()) -> None:
    """Check that a body is of the kind that a task needs, and has the verbs that it needs.

    Args:
        owner: The team or the player, for the message.
        body: Parameters of the body; their class is its kind.
        needed: The class that is needed; `BodyCfg` for any.
        verbs: Choices of the action part `verb` that are needed.

    Raises:
        ValueError: If the body is of another kind, lacks a verb, or its verbs reach nothing.
    """
    if not isinstance(body, needed):
        raise wrong_body(owner, needed)
    own = list(getattr(body, "verbs", ()))
    missing = sorted(set(verbs) - set(own))
    if missing:
        raise ValueError(
            f"{owner}: this task needs the verbs {list(verbs)}; body.verbs={own} lacks {missing}"
        )
    if verbs and not body.interaction_range_m > 0.0:
        raise ValueError(
            f"{owner}: this task needs the verbs {list(verbs)}, which reach nothing with "
            f"body.interaction_range_m={body.interaction_range_m}"
        )


def wrong_body(owner: str, needed: type[BodyCfg]) -> ValueError:
    """Return the error for a body of another kind than is needed, see `check_body`."""
    kind = _KINDS.get(needed, f"a body whose parameters are a {needed.__name__}")
    return ValueError(f"{owner}: this task needs {kind}")
