"""SAC and its presets learn from every form of observations, actions and teams."""

import math

import pytest
import torch
from composed import compose
from random_batches import random_batch

from veca_marl.algos.algorithm import make_algorithm
from veca_marl.algos.networks.multisense import Critic, Parameters
from veca_marl.algos.sac.config import ReplayCfg
from veca_marl.algos.specs import ActionLayout, ArrayLayout, TeamSpec

EYES = ArrayLayout((2, 3, 16, 16), "uint8", 0.0, 255.0)
EARS = ArrayLayout((2, 10), "float32", -8.0, 3.0)
ANGLES = ArrayLayout((12,), "float32", -math.inf, math.inf)
VECTOR, CHOICE = ActionLayout(False, 3), ActionLayout(True, 5)
FORMS = {
    "walker": TeamSpec(1, {"audio": EARS, "vision": EYES}, {"action": VECTOR}),
    "discrete": TeamSpec(2, {"vision": EYES}, {"action": CHOICE}, masked=True),
    "voice": TeamSpec(3, {"audio": EARS}, {"joints": VECTOR, "voice": CHOICE}, masked=True),
    "two_choices": TeamSpec(2, {"p": ANGLES}, {"move": ActionLayout(True, 7), "voice": CHOICE}),
    "two_vectors": TeamSpec(1, {"p": ANGLES}, {"arms": VECTOR, "legs": ActionLayout(False, 1)}),
}


@pytest.fixture(scope="module", params=["sac", "sac_fast", "crossq"])
def numbers(request):
    """A preset with a small replay buffer and updates from the first batch on."""
    cfg = compose(["+task=KickTheBall", f"algo={request.param}"]).algo
    cfg.replay, cfg.batch_size = ReplayCfg(64, warm_up_frames=1), 8
    return cfg


SHARED, SEPARATE = (Parameters.shared, Critic.own), (Parameters.separate, Critic.central)


@pytest.mark.parametrize(
    ("form", "network"),
    [*((form, SHARED) for form in FORMS), ("voice", SEPARATE), ("two_choices", SEPARATE)],
)
def test_it_learns_from_every_form(numbers, form, network):
    torch.manual_seed(0)
    parameters, critic = network
    numbers.network.parameters, numbers.network.critic = parameters, critic
    learner = make_algorithm("team", FORMS[form], numbers, torch.device("cpu"))
    before = {name: p.clone() for name, p in learner.network.named_parameters()}
    batch = random_batch({"team": FORMS[form]})
    measured = learner.learn(batch)
    assert list(measured) == list(learner.measures)
    assert all(math.isfinite(value) for value in measured.values())
    assert measured["updates"] == batch.numel() * numbers.updates_per_frame
    unchanged = [n for n, p in learner.network.named_parameters() if torch.equal(p, before[n])]
    assert unchanged == []
