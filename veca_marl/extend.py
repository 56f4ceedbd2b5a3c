"""What tasks, senses, bodies, interactions, networks and algorithms of your own are made from.

Guides, examples and plug-ins import from here, whatever the inner structure of the package::

    from veca_marl.extend import Player, Task, TaskCfg, register_task, terms

A name is imported at its first use, so that a plug-in that adds a task loads no learning library.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from veca_marl.algos.algorithm import Algorithm as Algorithm
    from veca_marl.algos.algorithm import AlgorithmCfg as AlgorithmCfg
    from veca_marl.algos.algorithm import make_algorithm as make_algorithm
    from veca_marl.algos.algorithm import register_algorithm as register_algorithm
    from veca_marl.algos.intrinsic.intrinsic_reward import IntrinsicCfg as IntrinsicCfg
    from veca_marl.algos.intrinsic.intrinsic_reward import IntrinsicReward as IntrinsicReward
    from veca_marl.algos.intrinsic.intrinsic_reward import register_intrinsic as register_intrinsic
    from veca_marl.algos.networks.factory import NetworkCfg as NetworkCfg
    from veca_marl.algos.networks.factory import NetworkFactory as NetworkFactory
    from veca_marl.algos.networks.factory import make_network as make_network
    from veca_marl.algos.networks.factory import register_network as register_network
    from veca_marl.algos.networks.memory import with_memory as with_memory
    from veca_marl.algos.networks.multisense import Memory as Memory
    from veca_marl.algos.networks.multisense import MultisenseCfg as MultisenseCfg
    from veca_marl.algos.networks.policy_heads import action_log_prob as action_log_prob
    from veca_marl.algos.specs import team_specs as team_specs
    from veca_marl.envs.adapters.torchrl.env import VecaEnv as VecaEnv
    from veca_marl.envs.adapters.torchrl.scripted import ExpertPolicy as ExpertPolicy
    from veca_marl.envs.core.expert import Expert as Expert
    from veca_marl.envs.core.expert import find_expert as find_expert
    from veca_marl.envs.core.expert import register_expert as register_expert
    from veca_marl.envs.core.game import Game as Game
    from veca_marl.envs.core.snapshot import Snapshot as Snapshot
    from veca_marl.envs.core.task import Player as Player
    from veca_marl.envs.core.task import Task as Task
    from veca_marl.envs.core.task import TaskCfg as TaskCfg
    from veca_marl.envs.core.task import Team as Team
    from veca_marl.envs.core.task import find_task as find_task
    from veca_marl.envs.core.task import register_task as register_task
    from veca_marl.envs.core.task import terms as terms
    from veca_marl.sim.body.base import Body as Body
    from veca_marl.sim.body.body_cfg import BodyCfg as BodyCfg
    from veca_marl.sim.body.humanoid import Humanoid as Humanoid
    from veca_marl.sim.body.humanoid import HumanoidCfg as HumanoidCfg
    from veca_marl.sim.body.registry import register_body as register_body
    from veca_marl.sim.body.walker import WalkCommand as WalkCommand
    from veca_marl.sim.body.walker import Walker as Walker
    from veca_marl.sim.body.walker import WalkerCfg as WalkerCfg
    from veca_marl.sim.physics.clock import ClockCfg as ClockCfg
    from veca_marl.sim.physics.interactions import FootInteraction as FootInteraction
    from veca_marl.sim.physics.interactions import InteractingBody as InteractingBody
    from veca_marl.sim.physics.interactions import Interaction as Interaction
    from veca_marl.sim.physics.interactions import register_interaction as register_interaction
    from veca_marl.sim.physics.playground import PlaygroundCfg as PlaygroundCfg
    from veca_marl.sim.physics.props import JointCfg as JointCfg
    from veca_marl.sim.physics.props import JointKind as JointKind
    from veca_marl.sim.physics.props import LockCfg as LockCfg
    from veca_marl.sim.physics.props import Prop as Prop
    from veca_marl.sim.physics.props import PropCfg as PropCfg
    from veca_marl.sim.physics.props import PropShape as PropShape
    from veca_marl.sim.physics.rooms import DoorCfg as DoorCfg
    from veca_marl.sim.physics.rooms import LeafCfg as LeafCfg
    from veca_marl.sim.physics.rooms import RoomCfg as RoomCfg
    from veca_marl.sim.physics.world import World as World
    from veca_marl.sim.sense import ArraySpec as ArraySpec
    from veca_marl.sim.sense import Sense as Sense
    from veca_marl.sim.senses import register_sense as register_sense
    from veca_marl.sim.sound import Call as Call
    from veca_marl.sim.sound import SoundCfg as SoundCfg
    from veca_marl.sim.sound import SoundKind as SoundKind

_HOMES = {
    "Algorithm": "veca_marl.algos.algorithm",
    "AlgorithmCfg": "veca_marl.algos.algorithm",
    "ArraySpec": "veca_marl.sim.sense",
    "Body": "veca_marl.sim.body.base",
    "BodyCfg": "veca_marl.sim.body.body_cfg",
    "Call": "veca_marl.sim.sound",
    "ClockCfg": "veca_marl.sim.physics.clock",
    "DoorCfg": "veca_marl.sim.physics.rooms",
    "Expert": "veca_marl.envs.core.expert",
    "ExpertPolicy": "veca_marl.envs.adapters.torchrl.scripted",
    "FootInteraction": "veca_marl.sim.physics.interactions",
    "Game": "veca_marl.envs.core.game",
    "Humanoid": "veca_marl.sim.body.humanoid",
    "HumanoidCfg": "veca_marl.sim.body.humanoid",
    "InteractingBody": "veca_marl.sim.physics.interactions",
    "Interaction": "veca_marl.sim.physics.interactions",
    "IntrinsicCfg": "veca_marl.algos.intrinsic.intrinsic_reward",
    "IntrinsicReward": "veca_marl.algos.intrinsic.intrinsic_reward",
    "JointCfg": "veca_marl.sim.physics.props",
    "JointKind": "veca_marl.sim.physics.props",
    "LeafCfg": "veca_marl.sim.physics.rooms",
    "LockCfg": "veca_marl.sim.physics.props",
    "Memory": "veca_marl.algos.networks.multisense",
    "MultisenseCfg": "veca_marl.algos.networks.multisense",
    "NetworkCfg": "veca_marl.algos.networks.factory",
    "NetworkFactory": "veca_marl.algos.networks.factory",
    "Player": "veca_marl.envs.core.task",
    "PlaygroundCfg": "veca_marl.sim.physics.playground",
    "Prop": "veca_marl.sim.physics.props",
    "PropCfg": "veca_marl.sim.physics.props",
    "PropShape": "veca_marl.sim.physics.props",
    "RoomCfg": "veca_marl.sim.physics.rooms",
    "Sense": "veca_marl.sim.sense",
    "Snapshot": "veca_marl.envs.core.snapshot",
    "SoundCfg": "veca_marl.sim.sound",
    "SoundKind": "veca_marl.sim.sound",
    "Task": "veca_marl.envs.core.task",
    "TaskCfg": "veca_marl.envs.core.task",
    "Team": "veca_marl.envs.core.task",
    "VecaEnv": "veca_marl.envs.adapters.torchrl.env",
    "WalkCommand": "veca_marl.sim.body.walker",
    "Walker": "veca_marl.sim.body.walker",
    "WalkerCfg": "veca_marl.sim.body.walker",
    "World": "veca_marl.sim.physics.world",
    "action_log_prob": "veca_marl.algos.networks.policy_heads",
    "find_expert": "veca_marl.envs.core.expert",
    "find_task": "veca_marl.envs.core.task",
    "make_algorithm": "veca_marl.algos.algorithm",
    "make_network": "veca_marl.algos.networks.factory",
    "register_algorithm": "veca_marl.algos.algorithm",
    "register_body": "veca_marl.sim.body.registry",
    "register_expert": "veca_marl.envs.core.expert",
    "register_interaction": "veca_marl.sim.physics.interactions",
    "register_intrinsic": "veca_marl.algos.intrinsic.intrinsic_reward",
    "register_network": "veca_marl.algos.networks.factory",
    "register_sense": "veca_marl.sim.senses",
    "register_task": "veca_marl.envs.core.task",
    "team_specs": "veca_marl.algos.specs",
    "terms": "veca_marl.envs.core.task",
    "with_memory": "veca_marl.algos.networks.memory",
}

__all__ = sorted(_HOMES)


def __getattr__(name: str) -> Any:
    """Import a name from its module (PEP 562)."""
    if name not in _HOMES:
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}; choices: {__all__}")
    return getattr(import_module(_HOMES[name]), name)


def __dir__() -> list[str]:
    """Return what can be imported, for completion."""
    return [*__all__]
