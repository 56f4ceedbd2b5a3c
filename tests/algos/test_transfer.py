"""Teams that start from other runs: whole teams, encoders of single senses, frozen encoders."""

import math
from pathlib import Path

import pytest
import torch
from fake_env import make_fake_env
from refusals import naming
from toy_dqn import ToyDQNCfg, register
from training import SMALL

from veca_marl.algos.checkpoints import CheckpointError, Checkpoints, Identity, to_plain
from veca_marl.algos.intrinsic.predictors import RNDCfg
from veca_marl.algos.networks.action_values import ActionValuesCfg
from veca_marl.algos.networks.encoders import (
    Convolutions,
    ImageEncoder,
    Pooling,
    VectorEncoder,
)
from veca_marl.algos.networks.memory import with_memory
from veca_marl.algos.networks.multisense import Memory, MultisenseCfg, Parameters
from veca_marl.algos.ppo import PPOCfg
from veca_marl.algos.ppo.value_normalisation import ValueNormalisation
from veca_marl.algos.sac import SACCfg
from veca_marl.algos.sac.config import ReplayCfg
from veca_marl.algos.sac.replay import Replay
from veca_marl.algos.sense_encoders import SenseEncoders, copy_encoders, sense_encoders
from veca_marl.algos.specs import ArrayLayout, TeamSpec, team_specs
from veca_marl.algos.training.learners import TeamLearners
from veca_marl.algos.transfer import init_teams

register()
CPU = torch.device("cpu")


def small_sac(**numbers):
    replay = ReplayCfg(capacity=256, warm_up_frames=16)
    return SACCfg(batch_size=16, updates_per_frame=0.1, replay=replay, **numbers)


def sac_with_stored_rows(folder, bytes_of_rows=0):
    """Return SAC that has learnt, and its run, whose checkpoint contains the replay buffer."""
    replay = ReplayCfg(capacity=256, warm_up_frames=16, in_checkpoint=True)
    cfg = SACCfg(network=network(), batch_size=16, updates_per_frame=0.1, replay=replay)
    learners = make_learners(seed=1, algo=cfg)
    with torch.no_grad():
        env = make_fake_env(4, 0, agents=2)
        batch = env.rollout(16, learners.policy.collect, break_when_any_done=False)
    learners.learn(batch)
    return learners, store(learners, folder, {"more": torch.zeros(bytes_of_rows // 4)})


def network(**numbers):
    return MultisenseCfg(**{**vars(SMALL), **numbers})


def make_learners(seed=0, algo=None, teams=("agents",), discrete=False, **numbers):
    torch.manual_seed(seed)
    specs = team_specs(make_fake_env(1, 0, teams=teams, discrete=discrete, agents=2))
    return TeamLearners(specs, algo or PPOCfg(network=network(**numbers)), CPU)


def store(learners, folder, more=None):
    checkpoints = Checkpoints(folder / "checkpoints", Identity("Toy", learners.specs), {})
    numbers = {team: to_plain(cfg) for team, cfg in learners.cfgs.items()}
    state = {"algorithm": learners.state_dict(), "actors": learners.actor_states()}
    state |= more or {}
    checkpoints.save(state, 0, best=False, algorithms=numbers)
    return str(folder)


def encoders(learners, team="agents"):
    found = sense_encoders(learners.algorithms[team].actor)
    return {
        sense: [torch.cat([p.detach().flatten().clone() for p in m.parameters()]) for m in modules]
        for sense, modules in found.items()
    }


def test_one_encoder_starts_from_a_run_of_another_game(tmp_path):
    """Another action, another critic: only the shape of the sense has to be equal."""
    there = make_learners(seed=1, discrete=True, critic=SMALL.critic, trunk_features=8)
    here = make_learners(seed=2)
    before = encoders(here)
    init_teams(here, {}, {"agents": {"vision": store(there, tmp_path)}})
    after, learnt = encoders(here), encoders(there)
    assert torch.equal(after["vision"][0], learnt["vision"][0])
    assert not torch.equal(before["vision"][0], learnt["vision"][0])
    assert torch.equal(after["audio"][0], before["audio"][0])


def test_an_encoder_is_copied_to_each_agent_with_one_of_its_own(tmp_path):
    there, here = make_learners(seed=1), make_learners(seed=2, parameters=Parameters.separate)
    init_teams(here, {}, {"agents": {"audio": store(there, tmp_path)}})
    (learnt,) = encoders(there)["audio"]
    assert [torch.equal(mine, learnt) for mine in encoders(here)["audio"]] == [True, True]


def test_the_encoders_of_separate_agents_do_not_fit_a_shared_one(tmp_path):
    there, here = make_learners(seed=1, parameters=Parameters.separate), make_learners(seed=2)
    with pytest.raises(CheckpointError, match=naming("agents.audio", " 2 ", " 1 ")):
        init_teams(here, {}, {"agents": {"audio": store(there, tmp_path)}})


def test_teams_are_found_by_name_or_named_by_the_source(tmp_path):
    there = make_learners(seed=1, teams=("red", "blue"))
    source = store(there, tmp_path)
    here = make_learners(seed=2)
    with pytest.raises(CheckpointError, match=naming("'agents'", "'blue'", "'red'")):
        init_teams(here, {"agents": source}, {})
    init_teams(here, {"agents": f"{source}:blue"}, {})
    assert torch.equal(encoders(here)["vision"][0], encoders(there, "blue")["vision"][0])
    both = make_learners(seed=3, teams=("red", "blue"))
    init_teams(both, {"red": source}, {"red": {"audio": f"{source}:blue"}})
    assert torch.equal(encoders(both, "red")["vision"][0], encoders(there, "red")["vision"][0])
    assert torch.equal(encoders(both, "red")["audio"][0], encoders(there, "blue")["audio"][0])


@pytest.mark.parametrize(
    ("numbers", "sense", "parts"),
    [
        (
            {"channels": [4, 8, 9]},
            "vision",
            ("layers.4.bias", "(9,)"),
        ),
        ({}, "smell", ("audio", "vision")),
    ],
)
def test_an_encoder_that_does_not_fit_is_refused(tmp_path, numbers, sense, parts):
    source = store(make_learners(**numbers), tmp_path)
    with pytest.raises(CheckpointError, match=naming(f"init_encoders.agents.{sense}", *parts)):
        init_teams(make_learners(), {}, {"agents": {sense: source}})


def test_an_actor_of_another_algorithm_with_another_network_is_refused(tmp_path):
    there = make_learners(algo=ToyDQNCfg(), discrete=True)
    with pytest.raises(CheckpointError, match=naming("init_from.agents=", "absent")):
        init_teams(make_learners(discrete=True), {"agents": store(there, tmp_path)}, {})


def test_further_layers_of_the_actor_of_sac_are_named(tmp_path):
    source = store(make_learners(algo=small_sac(network=network())), tmp_path)
    with pytest.raises(CheckpointError, match=r"policy_hidden=\[\d+\].* \[\]"):
        init_teams(make_learners(), {"agents": source}, {})


def test_a_critic_with_normalised_values_fits_none_without(tmp_path):
    kinds = ValueNormalisation.running, ValueNormalisation.none
    there, here = (
        make_learners(algo=PPOCfg(network=network(), value_normalisation=kind)) for kind in kinds
    )
    parts = ("algo.value_normalisation=running", " none ")
    with pytest.raises(CheckpointError, match=naming(*parts)):
        init_teams(here, {"agents": store(there, tmp_path)}, {})


@pytest.mark.parametrize(
    ("teams", "senses", "option"),
    [
        ({"agents": "nowhere"}, {}, "init_from.agents=nowhere"),
        ({}, {"agents": {"audio": "nowhere"}}, "init_encoders.agents.audio=nowhere"),
    ],
)
def test_a_source_that_is_missing_is_named_with_its_option(teams, senses, option):
    with pytest.raises(CheckpointError, match=option):
        init_teams(make_learners(), teams, senses)


@pytest.mark.parametrize("make_cfg", [PPOCfg, small_sac], ids=["ppo", "sac"])
def test_frozen_encoders_keep_their_parameters_and_have_no_optimiser_state(make_cfg):
    learners = make_learners(algo=make_cfg(network=network(frozen=["vision"])))
    algorithm = learners.algorithms["agents"]
    before = encoders(learners)
    with torch.no_grad():
        batch = make_fake_env(4, 0, agents=2).rollout(
            16, learners.policy.collect, break_when_any_done=False
        )
    algorithm.learn(batch)
    after = encoders(learners)
    assert torch.equal(after["vision"][0], before["vision"][0])
    assert not torch.equal(after["audio"][0], before["audio"][0])
    optimisers = [one for name, one in vars(algorithm).items() if name.endswith("optimizer")]
    groups = [group for optimiser in optimisers for group in optimiser.param_groups]
    optimised = {id(p) for group in groups for p in group["params"]}
    (vision,) = sense_encoders(algorithm.actor)["vision"]
    assert not optimised & {id(p) for p in vision.parameters()}
    assert {id(p) for p in algorithm.network.parameters() if p.requires_grad} <= optimised


def test_target_networks_start_with_the_encoders_of_the_other_run(tmp_path):
    there, here = make_learners(seed=1), make_learners(seed=2, algo=small_sac(network=network()))
    init_teams(here, {}, {"agents": {"vision": store(there, tmp_path)}})
    loss = here.algorithms["agents"].loss
    assert torch.equal(encoders(here)["vision"][0], encoders(there)["vision"][0])
    pairs = zip(loss.critic.parameters(), loss.target.parameters(), strict=True)
    assert all(torch.equal(one, other) for one, other in pairs)


def test_an_actor_is_copied_between_algorithms_with_the_same_network(tmp_path):
    cfg = small_sac(network=network(), policy_hidden=[])
    there, here = make_learners(seed=1), make_learners(seed=2, algo=cfg)
    init_teams(here, {"agents": store(there, tmp_path)}, {})
    mine, other = (each.policy.actors["agents"].state_dict() for each in (here, there))
    assert all(torch.equal(mine[name], other[name]) for name in other)


def test_an_actor_with_another_scale_of_actions_is_refused(tmp_path):
    """Equal parameters would be another policy: the initial scale is not one of them."""
    cfg = small_sac(network=network(initial_scale=0.1), policy_hidden=[])
    there, here = make_learners(seed=1), make_learners(seed=2, algo=cfg)
    with pytest.raises(CheckpointError, match=naming("initial_scale=1.0", " 0.1 ")):
        init_teams(here, {"agents": store(there, tmp_path)}, {})


@pytest.mark.parametrize(
    ("low", "high", "compressed"), [(-2.0, 1.0, False), (-math.inf, math.inf, True)]
)
def test_an_encoder_with_another_scale_of_its_input_is_refused(low, high, compressed):
    """Equal parameters would be another function: the scale is not one of them."""

    def encoder(low=-math.inf, high=math.inf, compressed=False):
        layout = ArrayLayout((3,), "float32", low, high)
        return SenseEncoders({"audio": VectorEncoder(layout, 4, compressed)})

    copy_encoders(encoder(), {"audio": [encoder()["audio"]]})
    with pytest.raises(ValueError, match=r"audio: [^<]*\bscale\b[^<]*$"):
        copy_encoders(encoder(), {"audio": [encoder(low, high, compressed)["audio"]]})


@pytest.mark.parametrize(
    ("size", "strides", "parts"),
    [
        (64, (4, 2, 1), ("input", "(3, 64, 64)", "(3, 84, 84)")),
        (84, (2, 2, 1), ("strides", "(2, 2, 1)", "(4, 2, 1)")),
    ],
)
def test_an_encoder_of_other_images_or_strides_is_refused(size, strides, parts):
    """Pooled to places, the parameters are equal: the images are not the same to them."""

    def encoder(size=84, strides=(4, 2, 1)):
        convolutions = Convolutions(strides=strides)
        return SenseEncoders(
            {"vision": ImageEncoder((3, size, size), convolutions, Pooling.places)}
        )

    copy_encoders(encoder(), {"vision": [encoder()["vision"]]})
    with pytest.raises(ValueError, match=naming("vision", *parts)):
        copy_encoders(encoder(), {"vision": [encoder(size, strides)["vision"]]})


def test_the_message_names_the_layers_of_an_actor_that_another_algorithm_has_not(tmp_path):
    there, here = make_learners(), make_learners(algo=SACCfg(network=network()))
    parts = ("algo.policy_hidden=[]", "[256]", "PPO")
    with pytest.raises(CheckpointError, match=naming(*parts)):
        init_teams(here, {"agents": store(there, tmp_path)}, {})


@pytest.mark.parametrize(
    ("sizes", "parts"),
    [
        (
            {"policy_hidden": [16]},
            ("algo.policy_hidden=[]", "[16]"),
        ),
        ({"critic": ActionValuesCfg(critics=3)}, ("algo.critic.critics=2", " 3 ")),
        (
            {"critic": ActionValuesCfg(hidden=[9])},
            ("algo.critic.hidden=", "[9]"),
        ),
    ],
)
def test_the_message_names_the_other_sizes_of_the_same_algorithm(tmp_path, sizes, parts):
    there = make_learners(algo=SACCfg(network=network(), policy_hidden=[]))
    here = make_learners(algo=SACCfg(network=network(), **{"policy_hidden": []} | sizes))
    with pytest.raises(CheckpointError, match=naming(*parts)):
        init_teams(here, {"agents": store(there, tmp_path)}, {})


def test_the_replay_buffer_of_the_other_run_is_not_rebuilt(tmp_path, monkeypatch):
    there, source = sac_with_stored_rows(tmp_path)
    written = []
    monkeypatch.setattr(Replay, "_write", lambda replay, rows: written.append(len(rows)))
    here = make_learners(seed=2, algo=small_sac(network=network()))
    init_teams(here, {"agents": source}, {})
    assert written == []
    mine, other = (each.algorithms["agents"].network.state_dict() for each in (here, there))
    assert all(torch.equal(mine[name], other[name]) for name in other)


@pytest.mark.skipif(not Path("/proc/self/io").is_file(), reason="counts what Linux has read")
@pytest.mark.parametrize("senses", [[], ["vision"]], ids=["team", "encoder"])
def test_of_a_large_checkpoint_only_the_networks_are_read(tmp_path, senses):
    size = 50_000_000
    _, source = sac_with_stored_rows(tmp_path, size)
    here = make_learners(seed=2, algo=small_sac(network=network()))
    before = bytes_read()
    if senses:
        init_teams(here, {}, {"agents": dict.fromkeys(senses, source)})
    else:
        init_teams(here, {"agents": source}, {})
    assert bytes_read() - before < 0.1 * size


def bytes_read():
    """Return the bytes that this process has read from files so far, page faults left out."""
    return int(Path("/proc/self/io").read_text().split()[1])


def test_a_frozen_team_starts_from_a_run_that_was_not_frozen(tmp_path):
    there, here = make_learners(seed=1), make_learners(seed=2, frozen=["vision"])
    init_teams(here, {"agents": store(there, tmp_path)}, {})
    assert torch.equal(encoders(here)["vision"][0], encoders(there)["vision"][0])


def test_a_frozen_sense_without_encoder_is_refused():
    with pytest.raises(ValueError, match=naming("'agents'", "smell", "vision")):
        make_learners(frozen=["smell"])


def test_specs_are_restored_from_plain_data():
    for spec in make_learners(teams=("red", "blue")).specs.values():
        assert TeamSpec.from_dict(spec.to_dict()) == spec


def test_a_recurrent_network_takes_frozen_encoders_intrinsic_rewards_and_popart(tmp_path):
    recurrent = network(memory=Memory.gru, frozen=["vision"])
    popart = ValueNormalisation.popart
    cfg = PPOCfg(network=recurrent, sequence_steps=8, value_normalisation=popart)
    torch.manual_seed(2)
    specs = team_specs(make_fake_env(1, 0, agents=2))
    here = TeamLearners(specs, cfg, CPU, intrinsic={"agents": RNDCfg()})
    there = make_learners(seed=1)
    init_teams(here, {}, {"agents": {"vision": store(there, tmp_path)}})
    env = with_memory(make_fake_env(4, 0, agents=2), here.policy.collect)
    with torch.no_grad():
        batch = env.rollout(16, here.policy.collect, break_when_any_done=False)
    measures = here.learn(batch)["agents"]
    assert measures["value_loss"] < 10.0
    assert measures["intrinsic_loss"] > 0.0
    assert torch.equal(encoders(here)["vision"][0], encoders(there)["vision"][0])
