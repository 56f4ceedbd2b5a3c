"""Value normalisation: statistics, preserved outputs (PopArt), limiting cases, state."""

from copy import deepcopy

import numpy as np
import pytest
import torch
from fake_env import FakeEnv
from refusals import naming
from tensordict import TensorDict
from tensordict.nn import TensorDictModule
from torch import nn
from torchrl.envs import ExplorationType, set_exploration_type
from training import SMALL

from veca_marl.algos.networks.factory import make_network
from veca_marl.algos.networks.multisense import Critic, MultisenseCfg, Parameters
from veca_marl.algos.ppo.value_normalisation import NormalisedCritic, ValueNormalisation
from veca_marl.algos.specs import team_specs

KEY = ("agents", "state_value")
NORMALISED = [ValueNormalisation.running, ValueNormalisation.popart]


def experience(ppo, worlds=8, steps=32, **env):
    with torch.no_grad(), set_exploration_type(ExplorationType.RANDOM):
        return FakeEnv(worlds, senses=("audio",), **env).rollout(
            steps, ppo.policy.collect, break_when_any_done=False
        )


def predictions(learner, rows):
    with torch.no_grad():
        return learner.network.critic(learner.network.encoder(rows.clone()))[KEY]


def make_critic(preserve, **network):
    torch.manual_seed(0)
    spec = team_specs(FakeEnv(1, agents=2, global_state=True))["agents"]
    made = make_network("agents", spec, MultisenseCfg(**{**vars(SMALL), **network}))
    with torch.no_grad():  # as large as after learning
        for layer in made.critic.modules():
            if isinstance(layer, torch.nn.Linear) and layer.out_features == 1:
                layer.weight.mul_(100.0)
    return NormalisedCritic(made.critic, KEY, preserve)


def values(normalised):
    features = torch.randn(5, 2, 32, generator=torch.Generator().manual_seed(0))
    read = {"agents": {"features": features}, "state": torch.ones(5, 2)}
    return normalised.critic(TensorDict(read, [5]))[KEY].detach()


@pytest.mark.parametrize("critic", Critic)
@pytest.mark.parametrize("parameters", Parameters)
def test_popart_preserves_predicted_values_when_the_statistics_change(critic, parameters):
    popart = make_critic(True, critic=critic, parameters=parameters)
    popart.update(torch.randn(64, 1) * 3.0 + 2.0)
    before, scale = values(popart), popart.statistics.scale().clone()
    popart.update(torch.randn(64, 1) * 500.0 - 1000.0)
    assert popart.statistics.scale() > 50.0 * scale
    assert before.std() > 0.1
    torch.testing.assert_close(values(popart), before, rtol=1e-4, atol=1e-3)


def test_without_popart_predicted_values_change_with_the_statistics():
    running = make_critic(False)
    running.update(torch.randn(64, 1))
    before = values(running)
    for _ in range(100):  # the mean moves by ten of the new deviations, which no output cancels
        running.update(torch.randn(64, 1) + 1000.0)
    assert (values(running) - before).abs().min() > 500.0


def test_statistics_are_those_of_all_targets_so_far():
    normalised = make_critic(True)
    batches = [torch.randn(64, 1) * 3.0 + shift for shift in (2.0, 4.0, -6.0)]
    for batch in batches:
        normalised.update(batch)
    together = np.concatenate([batch.numpy() for batch in batches])
    statistics = normalised.statistics
    assert statistics.scale().item() == pytest.approx(together.std(), rel=1e-3)
    assert statistics.denormalize(torch.zeros(1)).item() == pytest.approx(together.mean(), abs=1e-3)


@pytest.mark.parametrize("kind", NORMALISED)
def test_the_value_loss_keeps_its_scale_and_its_statistics_are_used(make_ppo, kind):
    """Returns of thousands; without normalisation the loss is above 1e5."""
    losses = {}
    for each in (ValueNormalisation.none, kind):
        ppo = make_ppo(senses=("audio",), value_normalisation=each)
        batch = experience(ppo)
        batch["next", "agents", "reward"] *= 1000.0
        losses[each] = ppo.learn(batch)["agents"]["value_loss"]
    assert losses[ValueNormalisation.none] > 1e5
    assert losses[kind] < 10.0


@pytest.mark.parametrize("kind", NORMALISED)
@pytest.mark.parametrize("constant", [0.0, 1e3])
def test_constant_targets_leave_the_loss_finite_and_are_predicted(make_ppo, kind, constant):
    """A variance of zero is limited from below; dividing the loss by it gave 1e11 here."""
    ppo = make_ppo(senses=("audio",), value_normalisation=kind)
    learner = ppo.algorithms["agents"]
    rows = learner.prepare(experience(ppo))
    rows["agents", "value_target"] = torch.full_like(rows["agents", "value_target"], constant)
    assert learner.learn_rows(rows)["value_loss"] < 10.0
    assert (predictions(learner, rows) - constant).abs().max() < 1.0


def test_a_normalised_critic_learns_returns_of_any_scale(make_ppo):
    """Without normalisation a step of the optimiser moves the prediction by less than 1."""
    errors = {}
    for kind in ValueNormalisation:
        ppo = make_ppo(senses=("audio",), value_normalisation=kind)
        learner = ppo.algorithms["agents"]
        rows = learner.prepare(experience(ppo))
        loud = rows["agents", "observation", "audio"].mean((-1, -2)).unsqueeze(-1) > -3.0
        rows["agents", "value_target"] = 5000.0 + 100.0 * loud
        for _ in range(3):
            learner.learn_rows(rows)
        errors[kind] = (predictions(learner, rows) - rows["agents", "value_target"]).abs().mean()
    assert errors[ValueNormalisation.none] > 3000.0
    assert errors[ValueNormalisation.running] < 50.0
    assert errors[ValueNormalisation.popart] < 50.0


@pytest.mark.parametrize("kind", NORMALISED)
def test_learning_continues_exactly_from_a_state(make_ppo, kind):
    one, other = (make_ppo(seed, senses=("audio",), value_normalisation=kind) for seed in (0, 7))
    batch = experience(one)
    one.learn(batch)
    other.load_state_dict(deepcopy(one.state_dict()))
    for ppo in (one, other):
        torch.manual_seed(1)
        ppo.learn(batch)
    mine, loaded = (ppo.algorithms["agents"].network.state_dict() for ppo in (one, other))
    assert any(name.endswith("running_mean") for name in mine)
    assert all(torch.equal(mine[name], loaded[name]) for name in mine)


def test_popart_needs_a_linear_layer_with_one_output():
    critic = TensorDictModule(nn.Tanh(), in_keys=[("agents", "features")], out_keys=[KEY])
    with pytest.raises(ValueError, match=naming("popart", "linear", "none", "running")):
        NormalisedCritic(critic, KEY, preserve=True)
