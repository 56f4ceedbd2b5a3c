"""What the page of a task says about its bodies: departures from the paper, discrete actions."""

from __future__ import annotations

from veca_marl.sim.body import BodyCfg
from veca_marl.sim.body.humanoid import Detail, HumanoidCfg
from veca_marl.sim.body.humanoid.joint_control import JointChoice

PAPER_RANGE_M = 1.5  # "closer than 1.5m" in the main text; the table of functions has 2.5 m
# tasks whose actions are "Continuous / Discrete" in the paper's table of tasks, and the body with
# which all parts of the action are discrete
DISCRETE_BODIES = {
    "DodgeCar": "walker_discrete",
    "KickTheBall": "walker_discrete",
    "MazeNav": "walker_discrete",
    "MultiAgentNav": "walker_discrete_voice",
    "ObjectNav": "walker_discrete",
}


def departures(body: BodyCfg) -> str:
    """Return in what a default body differs from that of the paper; empty if in nothing."""
    found = []
    if isinstance(body, HumanoidCfg) and not has_all_joints(body):
        found.append("in the paper all 82 joints move, knuckles included: `body=full`")
    if body.interaction_range_m != PAPER_RANGE_M:
        found.append(
            f"things are interactable within {body.interaction_range_m:g} m "
            f"(`body.interaction_range_m`), in the paper within {PAPER_RANGE_M:g} m"
        )
    return "; ".join(found)


def has_all_joints(body: HumanoidCfg) -> bool:
    """Return whether a joint-level body has moving fingers and an action for each joint."""
    return body.detail is Detail.full and body.joints is JointChoice.all


def discrete_form(task: str) -> str:
    """Return how to choose discrete actions, if the paper has them beside continuous ones."""
    if task not in DISCRETE_BODIES:
        return ""
    return f"`body={DISCRETE_BODIES[task]}`; the paper's table of tasks has both forms"
