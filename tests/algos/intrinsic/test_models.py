"""Models of intrinsic rewards: what is novel, what is predicted, limiting cases, masks."""

import math

import numpy as np
import pytest
import torch
from refusals import naming
from tensordict import TensorDict

from veca_marl.algos.intrinsic.prediction import NormalisedSenses
from veca_marl.algos.intrinsic.predictors import RND, ForwardModel, ForwardModelCfg, RNDCfg
from veca_marl.algos.specs import PLAIN, ActionLayout, ArrayLayout, TeamSpec

CPU = torch.device("cpu")
SPEC = TeamSpec(
    agents=2,
    observations={
        "proprioception": ArrayLayout((3,), "float32", -math.inf, math.inf),
        "vision": ArrayLayout((2, 3, 84, 84), "uint8", 0, 255),
        "touch": ArrayLayout((8,), "float32", -math.inf, math.inf),
    },
    actions={
        "move": ActionLayout(discrete=False, size=2),
        "voice": ActionLayout(discrete=True, size=3),
    },
    masked=True,
)
VECTOR = TeamSpec(
    agents=1,
    observations={"touch": SPEC.observations["touch"]},
    actions={PLAIN: ActionLayout(discrete=False, size=2)},
)
PLANE = TeamSpec(
    agents=1,
    observations={"touch": ArrayLayout((2,), "float32", -math.inf, math.inf)},
    actions={PLAIN: ActionLayout(discrete=False, size=1)},
)
MODELS = {"rnd": (RND, RNDCfg), "forward": (ForwardModel, ForwardModelCfg)}
both = pytest.mark.parametrize("kind", MODELS)


def make(kind, spec=VECTOR, **numbers):
    torch.manual_seed(0)
    model, cfg = MODELS[kind]
    return model("team", spec, cfg(**numbers), CPU)


@pytest.mark.parametrize(
    ("layout", "cells", "width"),
    [
        (ArrayLayout((2, 3, 84, 84), "uint8", 0, 255), 21, 6 * 21 * 21),
        (ArrayLayout((3, 16, 84), "uint8", 0, 255), 21, 3 * 4 * 21),
        (ArrayLayout((3, 16, 20), "uint8", 0, 255), 21, 3 * 16 * 20),
        (ArrayLayout((40, 250), "float32", 0, 1), 21, 40 * 250),
    ],
)
def test_images_are_averaged_to_at_most_so_many_cells_along_each_side(layout, cells, width):
    senses = NormalisedSenses({"sense": layout}, cells)
    vector = senses.read(TensorDict({"sense": torch.zeros(2, *layout.shape)}, [2]))
    assert vector.shape == (2, width)
    assert senses.widths == {"sense": width}


def batch_of(before, after, action):
    """Return a batch of one team from arrays ``(worlds, steps, agents, size)``."""
    lead = before.shape[:2]
    following = {"observation": {"touch": after}, "reward": torch.zeros(*before.shape[:3], 1)}
    team = {"observation": {"touch": before}, "action": action}
    return TensorDict({"team": team, "next": {"team": following}}, lead)


def transitions(agents=2, worlds=2, steps=4):
    """Return a batch with all kinds of arrays."""
    lead = (worlds, steps, agents)

    def observed():
        return {
            "proprioception": torch.randn(*lead, 3),
            "vision": torch.randint(0, 255, (*lead, 2, 3, 84, 84), dtype=torch.uint8),
            "touch": torch.randn(*lead, 8),
        }

    action = {"move": torch.rand(*lead, 2) * 2.0 - 1.0, "voice": torch.randint(0, 3, lead)}
    mask = torch.ones(lead, dtype=torch.bool)
    team = {"observation": observed(), "action": action, "mask": mask}
    after = {"observation": observed(), "mask": mask.clone(), "reward": torch.zeros(*lead, 1)}
    return TensorDict({"team": team, "next": {"team": after}}, lead[:2])


def test_novelty_falls_for_repeated_observations_and_stays_for_new_ones():
    torch.manual_seed(1)
    known, new = torch.randn(2, 4, 32, 1, 2).unbind()
    action = torch.zeros(4, 32, 1, 1)
    rnd = make("rnd", PLANE)
    first = rnd.learn(batch_of(known, known, action))[0].mean()
    for _ in range(40):
        repeated = rnd.learn(batch_of(known, known, action))[0].mean()
    mixed = torch.cat([known[:2], 2.0 + new[2:].abs()])
    rewards, _ = rnd.learn(batch_of(mixed, mixed, action))
    assert repeated < 0.2 * first
    assert rewards[:2].mean() < 0.5 * first
    assert rewards[2:].mean() > first


def linear_errors(effect, batches):
    """Return mean rewards of transitions of a linear system.

    Args:
        effect: Share of the action in what drives the system; the rest is noise.
        batches: Number of batches.
    """
    forward = make("forward", PLANE, warm_up=0, learning_rate=3e-3)
    system, control = torch.tensor([[0.8, -0.6], [0.6, 0.8]]), torch.tensor([[1.0, -1.0]])
    means = []
    for _ in range(batches):
        before = torch.rand(4, 32, 1, 2) * 2.0 - 1.0
        action, noise = (torch.rand(2, 4, 32, 1, 1) * 2.0 - 1.0).unbind()
        drive = effect * action + (1.0 - effect) * noise
        rewards, _ = forward.learn(batch_of(before, before @ system + drive @ control, action))
        means.append(float(rewards.mean()))
    return means


def test_the_error_of_a_linear_system_becomes_small_and_that_of_noise_does_not():
    known, noisy = linear_errors(1.0, 100), linear_errors(0.0, 100)
    assert np.mean(known[-5:]) < 0.3 * known[0]
    assert np.mean(noisy[-5:]) > 2.0 * np.mean(known[-5:])


@both
@pytest.mark.parametrize("constant", [0.0, 1e4])
def test_constant_observations_are_not_rewarded_for_long(kind, constant):
    model = make(kind)
    same = torch.full((2, 32, 1, 8), constant)
    for _ in range(30):
        rewards, measures = model.learn(batch_of(same, same, torch.zeros(2, 32, 1, 2)))
    assert rewards.isfinite().all()
    assert rewards.max() < 1e-3
    assert measures["intrinsic_loss"] < 1e-3


@both
def test_images_vectors_and_actions_of_several_parts_are_read(kind):
    model, batch = make(kind, SPEC), transitions()
    rewards, measures = model.learn(batch)
    assert rewards.shape == (2, 4, 2, 1)
    assert (rewards > 0.0).all()
    assert list(measures) == list(model.measures)
    assert model.senses.widths == {"vision": 2 * 3 * 21 * 21, "touch": 8}


def test_images_are_means_over_squares_of_pixels():
    rnd = make("rnd", SPEC, senses=["vision"])
    batch = transitions(steps=1, worlds=1)
    counted = torch.ones(1, 1, 2, dtype=torch.bool)
    found = rnd.read(batch, counted)
    images = batch["team", "observation", "vision"].double()
    expected = images.unflatten(-1, (21, 4)).unflatten(-3, (21, 4)).mean((-1, -3))
    torch.testing.assert_close(found, expected.reshape(2, -1).float())


@both
def test_steps_of_eliminated_agents_have_no_reward_and_are_not_learnt_from(kind):
    results = []
    for disturbance in (0.0, 100.0):
        model = make(kind, SPEC)
        torch.manual_seed(2)
        batch = transitions()
        batch["team", "mask"][:, 2:, 1] = False
        batch["next", "team", "mask"][:, 1:, 1] = False
        for part in (batch["team"], batch["next", "team"]):
            part["observation", "touch"][:, 2:, 1] += disturbance
        batch["next", "team", "observation", "touch"][:, 1, 1] += disturbance
        rewards, _ = model.learn(batch)
        assert (rewards[:, 1:, 1] == 0.0).all()
        assert (rewards[:, 0] > 0.0).all()
        results.append([rewards, *model.model.state_dict().values()])
    assert all(torch.equal(a, b) for a, b in zip(*results, strict=True))


@both
def test_a_batch_without_present_agents_is_accepted(kind):
    model, batch = make(kind, SPEC), transitions()
    batch["next", "team", "mask"][:] = False
    rewards, measures = model.learn(batch)
    assert (rewards == 0.0).all()
    assert math.isnan(measures["intrinsic_loss"])


@both
def test_it_continues_exactly_from_a_state(kind):
    one, other = make(kind, SPEC), make(kind, SPEC, warm_up=3)
    one.learn(transitions())
    other.load_state_dict(one.state_dict())
    batch = transitions()
    results = []
    for model in (one, other):
        torch.manual_seed(5)
        results.append(model.learn(batch)[0])
    assert torch.equal(*results)


def test_senses_are_all_but_proprioception_unless_they_are_named():
    assert list(make("rnd", SPEC).senses.widths) == ["vision", "touch"]
    assert list(make("rnd", SPEC, senses=["proprioception"]).senses.widths) == ["proprioception"]
    alone = TeamSpec(1, {"proprioception": SPEC.observations["proprioception"]}, VECTOR.actions)
    assert list(make("rnd", alone).senses.widths) == ["proprioception"]
    with pytest.raises(ValueError, match=naming("'team'", "smell", "vision", "touch")):
        make("rnd", SPEC, senses=["smell"])


@pytest.mark.parametrize(
    "wrong", [{"cells": 0}, {"learning_rate": 0.0}, {"coefficient": -1.0}, {"gamma": 1.0}]
)
def test_invalid_numbers_raise_an_error_with_their_name(wrong):
    ((name, number),) = wrong.items()
    with pytest.raises(ValueError, match=naming(f"intrinsic.{name}", number)):
        RNDCfg(**wrong)


@both
def test_the_first_batch_with_present_agents_is_learnt_more_often(kind):
    """An empty batch before it does not use up the warm-up."""
    rewards = []
    for empty in (False, True):
        model = make(kind, SPEC, warm_up=20)
        if empty:
            nobody = transitions()
            nobody["next", "team", "mask"][:] = False
            model.learn(nobody)
        rewards.append(float(model.learn(transitions())[0].mean()))
    assert rewards[1] == pytest.approx(rewards[0], rel=0.5)
