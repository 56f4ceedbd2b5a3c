"""The items of a digest, in jobs that run in processes of their own."""

from __future__ import annotations

import veca_marl
from tools.digests.hashing import Item
from tools.digests.plays import (
    Choice,
    ExpertPlay,
    GymnasiumPlay,
    PettingZooPlay,
    Picture,
    Rollout,
)
from tools.digests.trainings import Training

Job = tuple[Item, ...]

SUITES = ("veca", "babybench")
WALKER_BODIES = (
    "walker",
    "walker_carry",
    "walker_discrete",
    "walker_discrete_verbs",
    "walker_discrete_voice",
    "walker_open",
    "walker_press",
    "walker_verbs",
    "walker_voice",
)
JOINT_BODIES = (
    "full",
    "full_limbs",
    "full_position",
    "full_voice",
    "mitten",
    "mitten_increment",
    "mitten_limbs",
    "mitten_position",
    "mitten_voice",
)
SENSES = {
    "vision": ("binocular", "blind", "blur", "defocus", "grey", "infant", "monocular"),
    "audio": ("deaf", "hrtf", "hrtf_child", "hrtf_impacts", "mono", "stereo", "stereo_child"),
    "proprioception": ("full", "joints", "none", "vestibular"),
    "touch": ("binary", "coarse", "hands", "numb", "parts", "parts_only", "skin"),
}
PLAYGROUNDS = (
    "simple",
    "single_room",
    "two_rooms",
    "three_rooms",
    "four_rooms",
    "seven_rooms",
    "house",
    "house2",
    "random_house",
)
CLOCKS = ("agent4ms", "physics4ms")
TRAININGS = (
    Training("train/ppo", "KickTheBall"),
    Training("train/ppo_workers", "KickTheBall", ("collect=workers8", "collect.steps=16")),
    Training("train/ppo_hybrid", "KickTheBall", ("body=walker_voice",)),
    Training("train/ppo_gru", "KickTheBall", ("algo.network.memory=gru",)),
    Training("train/ppo_popart", "TurnBaby", ("algo.value_normalisation=popart",)),
    Training("train/rnd", "KickTheBall", ("intrinsic=rnd",)),
    Training("train/forward", "KickTheBall", ("intrinsic=forward",)),
    Training("train/mappo_team", "PushOut2v2", ("algo=mappo", "body=walker")),
    Training("train/ippo_elimination", "MultiAgentNav", ("algo=ippo", "playground=two_rooms")),
    Training(
        "train/self_play",
        "SoccerTwoPlayer",
        ("self_play.teams=[attacker,defender]", "body=walker"),
    ),
    Training("train/opponent", "SoccerTwoPlayer", ("opponent.defender=expert", "body=walker")),
    Training("train/sac", "KickTheBall", ("algo=sac", "algo.replay.warm_up_frames=128")),
    Training("train/sac_fast", "KickTheBall", ("algo=sac_fast", "algo.replay.warm_up_frames=128")),
    Training(
        "train/sac_gru",
        "KickTheBall",
        ("algo=sac", "algo.replay.warm_up_frames=128", "algo.network.memory=gru"),
    ),
    Training(
        "train/sac_hybrid",
        "KickTheBall",
        ("algo=sac", "algo.replay.warm_up_frames=128", "body=walker_voice"),
    ),
    Training("train/crossq", "CrawlBaby", ("algo=crossq", "algo.replay.warm_up_frames=128")),
)
TRAINING_JOBS = 4
"""How many jobs the training runs are distributed over; each job imports everything once."""


def quick_jobs() -> list[Job]:
    """Return a rollout of every task."""
    rollouts = [Rollout(f"rollout/{task}", Choice(task)) for task in _tasks()]
    return [tuple(rollouts[0::2]), tuple(rollouts[1::2])]


def all_jobs() -> list[Job]:
    """Return everything, what takes longest first."""
    trainings: list[Job] = [TRAININGS[first::TRAINING_JOBS] for first in range(TRAINING_JOBS)]
    return [*trainings, _experts(), _variants(), (*_playgrounds(), *_adapters()), *quick_jobs()]


def _tasks() -> list[str]:
    return [task for suite in SUITES for task in veca_marl.list_tasks(suite=suite)]


def _experts() -> Job:
    """Return an episode of the expert of every task of the paper."""
    return tuple(ExpertPlay(f"expert/{task}", Choice(task)) for task in veca_marl.list_tasks())


def _variants() -> Job:
    """Return rollouts with each body, each quality of each sense and each clock."""
    walkers = [
        Rollout(f"body/{body}", Choice("KickTheBall", body=body, senses={"touch": "skin"}))
        for body in WALKER_BODIES
    ]
    joints = [
        Rollout(f"body/{body}", Choice("SoccerOnePlayer", body=body)) for body in JOINT_BODIES
    ]
    senses = [
        Rollout(f"{sense}/{preset}", Choice("MultiAgentNav", senses={sense: preset}))
        for sense, presets in SENSES.items()
        for preset in presets
    ]
    clocks = [
        Rollout(f"clock/{clock}", Choice("KickTheBall", overrides=(f"clock={clock}",)))
        for clock in CLOCKS
    ]
    return (*walkers, *joints, *senses, *clocks)


def _playgrounds() -> Job:
    """Return rollouts of a walker in each playground, and in generated houses."""
    named = [
        Picture(f"playground/{name}", Choice("ObjectNav", playground=name)) for name in PLAYGROUNDS
    ]
    seeded = ("playground.seed=7", "playground.leaves=0.5")
    house = Choice("ObjectNav", playground="random_house", overrides=seeded)
    return (*named, Picture("playground/random_house_7", house))


def _adapters() -> Job:
    return (
        GymnasiumPlay("gymnasium/KickTheBall", "KickTheBall"),
        GymnasiumPlay("gymnasium/stacked", "GrabObject", "stacked"),
        PettingZooPlay("pettingzoo/PushOut2v2", "PushOut2v2"),
        PettingZooPlay("pettingzoo/MultiAgentNav", "MultiAgentNav"),
    )
