"""SAC learns the toy problem with every form of action, counts its updates and is stored."""

import math

import pytest
import torch
from fake_env import FakeEnv
from refusals import naming
from torchrl.data import Categorical
from training import SMALL, rewards_until

from veca_marl.algos.networks.action_values import ActionValuesCfg, Normalisation
from veca_marl.algos.networks.multisense import Critic, MultisenseCfg, Parameters
from veca_marl.algos.sac import SAC
from veca_marl.algos.sac.config import (
    Adaptation,
    EncoderGradient,
    ReplayCfg,
    SACCfg,
    Targets,
    TemperatureCfg,
)
from veca_marl.algos.specs import team_specs

FORMS = {"continuous": {}, "discrete": {"discrete": True}, "hybrid": {"hybrid": True}}

# With random actions for 64 frames only, one seed in sixteen keeps an action of which the replay
# buffer has no other example in a state.
LEARNING = {"replay": ReplayCfg(2048, warm_up_frames=256), "updates_per_frame": 0.25}


@torch.no_grad()
def return_of(policy, senses=("audio",), **env):
    """Return the mean reward of the policy's most likely actions; a random policy has 0."""
    played = FakeEnv(8, 7, senses=senses, **env).rollout(
        16, policy=policy, break_when_any_done=False
    )
    return float(played["next", "agents", "reward"].mean())


def last_return(algorithm, collect, batches=20, **env):
    """Return the mean reward after as many batches as are needed for 0.9, or after all."""
    seeds = iter(range(batches))

    def learn():
        algorithm.learn(collect(algorithm, seed=next(seeds), **env))
        return return_of(algorithm.actor, **env)

    return rewards_until(0.9, learn, batches)[-1]


@pytest.mark.parametrize("form", FORMS.values(), ids=FORMS.keys())
def test_it_learns_every_form_of_action(make_sac, collect, form):
    algorithm = make_sac(changes=LEARNING, **form)
    assert last_return(algorithm, collect, **form) > 0.9


@pytest.mark.parametrize(
    ("critic", "parameters"),
    [(Critic.central, Parameters.shared), (Critic.own, Parameters.separate)],
)
def test_teams_learn_with_every_kind_of_parameters_and_critic(
    make_sac, collect, critic, parameters
):
    network = MultisenseCfg(**vars(SMALL) | {"critic": critic, "parameters": parameters})
    team = {"agents": 2, "hybrid": True}
    algorithm = make_sac(changes=LEARNING | {"network": network}, **team)
    assert last_return(algorithm, collect, **team) > 0.9


def test_it_learns_without_target_networks(make_sac, collect):
    critic = ActionValuesCfg(hidden=[32], normalisation=Normalisation.batch_renorm)
    changes = LEARNING | {"targets": Targets.same, "critic": critic}
    algorithm = make_sac(changes=changes, hybrid=True)
    assert "target" not in algorithm.state_dict()
    assert last_return(algorithm, collect, hybrid=True) > 0.9


@pytest.mark.slow
def test_it_learns_from_shifted_images_with_an_encoder_trained_by_the_critics(make_sac, collect):
    changes = LEARNING | {
        "critic": ActionValuesCfg(hidden=[64], normalisation=Normalisation.layer),
        "encoder_gradient": EncoderGradient.critic,
        "temperature": TemperatureCfg(0.1, Adaptation.automatic),
        # with the few channels of SMALL all units may be inactive on images of one brightness
        "network": MultisenseCfg(channels=[8, 16, 16], vector_features=16, trunk_features=64),
        "policy_hidden": [32],
        "random_shift": 2,
        "steps": 3,
        "learning_rate": 1e-3,
    }
    eyes = {"senses": ("vision",)}
    returns = []
    for seed in range(3):  # one network of about 30 stays at one action
        algorithm = make_sac(seed=seed, changes=changes, **eyes)
        before = algorithm.temperatures.alphas()
        returns.append(last_return(algorithm, collect, batches=40, **eyes))
        assert algorithm.temperatures.alphas() != before
    assert sorted(returns)[1] > 0.9


def test_first_values_are_small_against_the_rewards_of_a_step(make_sac, collect):
    algorithm = make_sac(seed=0)
    batch = collect(algorithm, seed=0)
    with torch.no_grad():
        features = algorithm.network.encoder(batch.flatten(0, 1))["agents", "features"]
        action = batch["agents", "action"].flatten(0, 1)
        values = algorithm.network.values(features, action)
    assert float(values.abs().max()) < 0.05
    assert float(values.std()) > 0.0


def test_temperatures_have_a_step_size_of_their_own(make_sac, collect):
    temperature = TemperatureCfg(0.1, Adaptation.automatic, learning_rate=0.02)
    algorithm = make_sac(changes={"temperature": temperature, "updates_per_frame": 0.25})
    algorithm.learn(collect(algorithm, seed=0))
    before = {name: p.detach().clone() for name, p in algorithm.temperatures.named_parameters()}
    algorithm.update()
    steps = [p - before[name] for name, p in algorithm.temperatures.named_parameters()]
    assert all(0.005 < float(step.detach().abs()) < 0.04 for step in steps)


def test_updates_do_not_lower_temperatures_below_their_minimum(make_sac, collect):
    alphas = {}
    for minimum in (0.0, 0.1):
        temperature = TemperatureCfg(
            0.1, Adaptation.automatic, entropy_per_dimension=-9.0, minimum=minimum
        )
        algorithm = make_sac(changes={"temperature": temperature, "updates_per_frame": 0.25})
        algorithm.learn(collect(algorithm, seed=0))
        alphas[minimum] = list(algorithm.temperatures.alphas().values())
    assert all(float(alpha) < 0.0999 for alpha in alphas[0.0])
    assert all(float(alpha) == pytest.approx(0.1) for alpha in alphas[0.1])


def test_updates_follow_the_frames_and_begin_after_the_warm_up(make_sac, collect):
    changes = {"updates_per_frame": 0.05, "replay": ReplayCfg(1024, warm_up_frames=100)}
    algorithm = make_sac(changes=changes)
    rows = [algorithm.learn(collect(algorithm, seed=seed)) for seed in range(4)]
    assert list(rows[0]) == list(algorithm.measures)
    assert math.isnan(rows[0]["critic_loss"])
    assert math.isfinite(rows[1]["critic_loss"])
    # 64 frames a batch: 3.2 updates from the second batch on, fractions carried over
    assert [row["updates"] for row in rows] == [0.0, 3.0, 6.0, 9.0]
    assert rows[-1]["updates_per_frame"] == pytest.approx(9 / 256)


def test_a_budget_of_the_warm_up_alone_is_the_least_with_updates(make_sac, collect):
    cfg = SACCfg(replay=ReplayCfg(1024, warm_up_frames=64))
    cfg.check_budget(64)
    row = make_sac(changes={"replay": cfg.replay}).learn(collect(make_sac()))
    assert row["updates"] > 0.0
    with pytest.raises(ValueError, match=naming("63", "algo.replay.warm_up_frames=64")):
        cfg.check_budget(63)


def test_actions_are_uniform_until_the_first_update(make_sac, collect):
    algorithm = make_sac(discrete=True)
    with torch.no_grad():
        algorithm.network.actor[1].module.bias.copy_(torch.tensor([50.0, -50.0]))
    share = [float(collect(algorithm, discrete=True)["agents", "action"].float().mean())]
    algorithm.learn(collect(algorithm, discrete=True))
    share.append(float(collect(algorithm, discrete=True)["agents", "action"].float().mean()))
    assert share[0] == pytest.approx(0.5, abs=0.2)
    assert share[1] < 0.1


def test_a_policy_that_was_learnt_before_acts_while_the_buffer_is_filled(make_sac, collect):
    changes = {"replay": ReplayCfg(1024, warm_up_frames=100)}
    earlier, continued, copied = (make_sac(changes=changes, seed=seed) for seed in range(3))
    for seed in range(2):
        earlier.learn(collect(earlier, seed=seed))
    continued.load_state_dict(earlier.state_dict())
    copied.init_from(earlier)
    for algorithm in (continued, copied):
        algorithm.learn(collect(algorithm))  # 64 frames: the buffer is not ready
        assert not algorithm.state_dict()["warm_up"]["active"]


class AbsentEnv(FakeEnv):
    """The toy in which no agent is present at any time."""

    def __init__(self, worlds):
        super().__init__(worlds)
        self.observation_spec["agents", "mask"] = Categorical(
            2, shape=(worlds, 1), dtype=torch.bool
        )

    def _team(self, right):
        return super()._team(right).set("mask", torch.zeros(right.shape[:2], dtype=torch.bool))


def test_samples_without_an_agent_that_is_present_change_nothing():
    env = AbsentEnv(4)
    temperature = TemperatureCfg(adaptation=Adaptation.automatic)
    cfg = SACCfg(network=SMALL, replay=ReplayCfg(2048, 64), temperature=temperature)
    torch.manual_seed(0)
    algorithm = SAC("agents", team_specs(env)["agents"], cfg, torch.device("cpu"))
    with torch.no_grad():
        batch = env.rollout(64, algorithm.explorer, break_when_any_done=False)
    before = [p.detach().clone() for p in algorithm.network.parameters()]
    alpha = algorithm.temperatures.alphas()
    measured = algorithm.learn(batch)
    assert measured["updates"] > 0
    assert math.isnan(measured["value"])
    after = algorithm.network.parameters()
    assert all(torch.equal(p, q) for p, q in zip(before, after, strict=True))
    assert algorithm.temperatures.alphas() == alpha


def test_a_gradient_that_is_not_finite_is_reported(make_sac, collect):
    algorithm = make_sac()
    batch = collect(algorithm)
    batch["next", "agents", "reward"][:] = math.nan
    with pytest.raises(FloatingPointError, match=naming("'agents'", "gradient", "nan")):
        algorithm.learn(batch)


@pytest.mark.parametrize(
    ("numbers", "parts"),
    [
        ({"gamma": 1.5}, ("algo.gamma", "1.5")),
        ({"tau": 0.0}, ("algo.tau", "0.0")),
        ({"batch_size": 0}, ("algo.batch_size", " 0")),
        ({"learning_rate": -1.0}, ("algo.learning_rate", "-1.0")),
        ({"random_shift": -1}, ("algo.random_shift", "-1")),
        (
            {"critic": ActionValuesCfg(normalisation=Normalisation.batch_renorm)},
            ("batch_renorm", "algo.targets=same"),
        ),
        ({"policy_hidden": [0]}, ("algo.policy_hidden", "[0]")),
    ],
)
def test_impossible_numbers_are_refused(numbers, parts):
    with pytest.raises(ValueError, match=naming(*parts)):
        SACCfg(**numbers)


def test_a_replay_buffer_that_is_too_small_for_a_batch_is_refused():
    with pytest.raises(ValueError, match=naming("capacity=100", "64")):
        SACCfg(replay=ReplayCfg(100, 10)).check_batch(4, 16)
