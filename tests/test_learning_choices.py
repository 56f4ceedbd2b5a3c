"""Algorithms, networks and loggers are choices of the configuration, also those of a user."""

import pytest
import torch
from first_seen import FirstSeenCfg
from refusals import naming
from toy_dqn import ToyDQNCfg, register

from veca_marl.algos.intrinsic.intrinsic_reward import IntrinsicCfg
from veca_marl.algos.intrinsic.predictors import ForwardModelCfg, RNDCfg
from veca_marl.algos.networks.encoders import Precision
from veca_marl.algos.networks.multisense import Critic, MultisenseCfg
from veca_marl.algos.ppo import PPOCfg
from veca_marl.algos.reporting import LoggerKind
from veca_marl.algos.transfer import load_actor
from veca_marl.config import ConfigError, compose, compose_node, to_config
from veca_marl.runs.assembly import decide_precision, make_trainer, read_specs
from veca_marl.runs.continuation import RunProgress
from veca_marl.runs.run_folder import RunFolder
from veca_marl.runs.training import run_training
from veca_marl.sweeps.run_state import RunState, read_run

register()
KICK = "+task=KickTheBall"
SMALL = [
    KICK,
    "task.max_seconds=1.0",
    "senses/vision=blind",
    "senses/proprioception=none",
    "collect=one_process",
    "collect.worlds=2",
    "collect.steps=16",
    "eval.episodes=2",
    "eval.worlds=2",
    "eval.every_frames=32",
    "total_frames=64",
    "log=silent",
    "threads=1",
]


def test_the_arithmetic_of_every_network_is_decided_before_a_run_is_stored(monkeypatch):
    monkeypatch.setattr(torch.cpu, "get_capabilities", lambda: {"avx512_bf16": True})
    node = compose_node([KICK, "+algo@learner.agents=mappo"])
    assert decide_precision(node) == [Precision.bfloat16, Precision.bfloat16]
    assert node.learner.agents.network.precision is Precision.bfloat16
    assert decide_precision(node) == [], "a decision is kept"
    assert decide_precision(compose_node([KICK, "algo.network.precision=float32"])) == []
    assert decide_precision(compose_node([KICK, "algo=toy_dqn"])) == [], "without such a number"


def test_an_algorithm_without_a_file_is_chosen_by_name():
    cfg = compose([KICK, "algo=toy_dqn", "algo.batch=16"])
    assert cfg.algo == ToyDQNCfg(batch=16)
    with pytest.raises(ConfigError, match=naming("clip")):
        compose([KICK, "algo=toy_dqn", "algo.clip=0.1"])
    with pytest.raises(ConfigError, match=naming("'pop'", "ppo")):
        compose([KICK, "algo=pop"])


def test_a_team_learns_by_an_algorithm_of_its_own():
    push = "+task=PushOut1v1"
    cfg = compose([push, "+algo@learner.blue=toy_dqn", "body=walker_discrete"])
    assert isinstance(cfg.algo, PPOCfg)
    assert cfg.learner == {"blue": ToyDQNCfg()}


@pytest.mark.slow
def test_a_network_is_chosen_by_name():
    assert compose([KICK]).algo.network == MultisenseCfg()
    assert compose([KICK, "algo=mappo"]).algo.network == MultisenseCfg(critic=Critic.central)
    assert compose([KICK, "algo/network=first_seen"]).algo.network == FirstSeenCfg()
    own = compose(["+task=PushOut1v1", "+algo@learner.red=mappo", "algo/network=first_seen"])
    assert own.algo.network == FirstSeenCfg()
    assert own.learner["red"].network == MultisenseCfg(critic=Critic.central)


@pytest.mark.slow
def test_loggers_are_chosen_by_name(monkeypatch):
    assert compose([KICK, "log.logger=[]"]).log.logger == []
    assert compose([KICK]).log.logger == [LoggerKind.csv, LoggerKind.tensorboard]
    monkeypatch.setattr("veca_marl.algos.reporting.find_spec", lambda name: None)
    stored = compose([KICK, "log.logger=[wandb]"])  # a run of another machine can be read
    with pytest.raises(ConfigError, match=naming("log.logger", "wandb", "pip install")):
        make_trainer(stored)
    with pytest.raises(ConfigError, match=r"wandbb"):
        compose([KICK, "log.logger=[wandbb]"])


def test_a_batch_that_an_algorithm_cannot_learn_from_is_refused():
    with pytest.raises(ConfigError, match=r"toy_dqn .*\b4\b.*\b2$"):
        compose([*SMALL, "algo=toy_dqn", "collect.worlds=1", "collect.steps=2"])


@pytest.mark.slow
def test_training_from_python_returns_rows_and_a_policy_and_stores_nothing(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    result = run_training(compose(SMALL))
    assert [row["frames"] for row in result.metrics] == [32, 64]
    assert {"agents/return", "agents/kick", "agents/kl"} <= result.metrics[0].keys()
    assert [row["player"] for row in result.evaluations] == ["random", "policy", "policy"]
    assert result.comparison[0].startswith("agents: return of policy")
    assert result.folder is None
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_a_recurrent_policy_is_trained_recorded_and_loaded(tmp_path):
    memory = ["algo.network.memory=gru", "algo.sequence_steps=8", "algo.minibatches=2"]
    cfg = compose([*SMALL, *memory, "log.video=true", "log.keep_checkpoints=1"])
    result = run_training(cfg, RunFolder(tmp_path))
    assert (tmp_path / "videos" / "final.mp4").stat().st_size > 0
    assert (tmp_path / "timing.txt").read_text() == f"{result.timing}\n"
    seconds = {line.split()[0]: float(line.split()[1]) for line in result.timing.splitlines()[1:]}
    assert 0.0 < seconds["evaluate/video"] <= seconds["evaluate"] <= seconds["total"]
    assert result.metrics[-1]["agents/kl"] >= 0.0
    actor = load_actor(tmp_path, "agents", read_specs(cfg.game)["agents"])
    assert ("agents", "memory", "hidden") in actor.in_keys


@pytest.mark.slow
@pytest.mark.parametrize(
    "body",
    [
        "walker_voice",
        "walker_discrete_voice",
        pytest.param("walker_verbs", marks=pytest.mark.slow),
    ],
)
def test_a_body_with_two_action_parts_is_trained(body):
    """The parts are move and voice, or move and verb."""
    result = run_training(compose([*SMALL, f"body={body}"]))
    assert result.metrics[-1]["agents/kl"] >= 0.0


@pytest.mark.slow
def test_verbs_are_learnt_from_a_replay_buffer():
    small = ["algo.replay.capacity=100", "algo.replay.warm_up_frames=20", "algo.batch_size=8"]
    small += ["task.max_seconds=0.4"]  # sums of info are known at the end of an episode
    row = run_training(compose([*SMALL, "algo=sac_fast", "body=walker_verbs", *small])).metrics[-1]
    assert {"agents/alpha_move", "agents/alpha_verb"} <= row.keys()
    assert row["agents/refused_verbs"] > 0.0  # KickTheBall has nothing that declares a verb


@pytest.mark.slow
def test_an_action_of_two_parts_is_learnt_from_a_replay_buffer(tmp_path):
    small = ["algo.replay.capacity=100", "algo.replay.warm_up_frames=20", "algo.batch_size=8"]
    cfg = compose([*SMALL, "algo=sac_fast", "body=walker_voice", *small])
    row = run_training(cfg, RunFolder(tmp_path)).metrics[-1]
    assert row["agents/updates"] == 16.0
    assert {"agents/alpha_move", "agents/alpha_voice"} <= row.keys()
    assert load_actor(tmp_path, "agents", read_specs(cfg.game)["agents"]).out_keys


def test_a_replay_buffer_that_does_not_fit_is_refused_before_the_run():
    with pytest.raises(ConfigError, match=naming("memory", "GB", "algo.replay.capacity")):
        run_training(compose([*SMALL, "algo=sac", "algo.replay.capacity=10_000_000_000"]))


@pytest.mark.slow
def test_a_run_without_loggers_stores_how_far_it_has_come(tmp_path, monkeypatch):
    stored = []
    monkeypatch.setattr(
        RunFolder, "write_progress", lambda _, progress: stored.append((progress, rest(tmp_path)))
    )
    node = compose_node([*SMALL, "log.logger=[]"])
    folder = RunFolder(tmp_path)
    folder.begin(node, [])
    run_training(to_config(node), folder)
    written = [(progress.frames, progress.ended) for progress, _ in stored]
    assert written == [(0, False), (32, False), (64, False), (64, True)]
    assert ["comparison.txt" in files for _, files in stored] == [False, False, False, True]
    folder.begin_again(node, [], 64)
    assert stored[-1][0] == RunProgress(64, False)


def rest(folder):
    return {path.name for path in folder.iterdir()}


@pytest.mark.slow
def test_a_sweep_knows_that_a_run_without_loggers_has_ended(tmp_path):
    node = compose_node([*SMALL, "log.logger=[]"])
    folder = RunFolder(tmp_path)
    folder.begin(node, [])
    run_training(to_config(node), folder)
    run = read_run(tmp_path)
    assert run.rows("evaluations") == []
    assert run.state(64, None) is RunState.finished
    assert run.state(65, None) is RunState.unfinished


def sac(warm_up_frames):
    replay = ["algo.replay.capacity=200", f"algo.replay.warm_up_frames={warm_up_frames}"]
    return [*SMALL, "algo=sac", "algo.batch_size=8", *replay]


def test_a_budget_without_an_update_is_refused_before_the_run(tmp_path):
    parts = ("total_frames=63", "'agents'", "algo.replay.warm_up_frames=65")
    with pytest.raises(ConfigError, match=naming(*parts)):
        run_training(compose([*sac(65), "total_frames=63"]), RunFolder(tmp_path))
    assert not list(tmp_path.iterdir())


@pytest.mark.slow
def test_a_run_that_starts_from_another_one_needs_frames_for_an_update_too(tmp_path):
    run_training(compose(sac(16)), RunFolder(tmp_path))
    with pytest.raises(ConfigError, match=naming("total_frames=64", "warm_up_frames=65")):
        make_trainer(compose([*sac(65), f"init_from.agents={tmp_path}"]))


@pytest.mark.parametrize(("seconds", "warned"), [(0.64, False), (0.68, True)])
def test_episodes_that_are_longer_than_the_steps_between_evaluations_are_named(
    caplog, seconds, warned
):
    make_trainer(compose([*SMALL, f"task.max_seconds={seconds}"]))  # 16 steps of 40 ms
    found = [text for text in warnings(caplog) if "episodes last up to 17 steps" in text]
    assert bool(found) is warned


@pytest.mark.slow
@pytest.mark.parametrize("stored", [False, True])
def test_a_resumed_run_that_ends_before_its_buffer_is_full_again_says_so(tmp_path, caplog, stored):
    choices = [f"algo.replay.in_checkpoint={stored}", "task.max_seconds=0.6"]
    run_training(compose([*sac(48), *choices]), RunFolder(tmp_path))
    resumed = [*sac(48), *choices, f"resume={tmp_path}"]
    make_trainer(compose(resumed), RunFolder(tmp_path))
    assert not warnings(caplog), "nothing is left to learn"
    make_trainer(compose([*resumed, "total_frames=96"]), RunFolder(tmp_path))
    said = (
        "team 'agents' learns nothing more: from frame 64 to total_frames=96, the 32 frames end "
        "before the first update, which needs algo.replay.warm_up_frames=48"
    )
    assert warnings(caplog) == ([] if stored else [said])


def warnings(caplog):
    return [record.getMessage() for record in caplog.records if record.levelname == "WARNING"]


@pytest.mark.slow
def test_intrinsic_rewards_are_chosen_by_name_also_for_a_team():
    push = "+task=PushOut1v1"
    assert compose([push]).intrinsic == IntrinsicCfg()
    chosen = compose([push, "intrinsic=forward", "intrinsic.senses=[vision]"])
    assert chosen.intrinsic == ForwardModelCfg(senses=["vision"])
    own = compose([push, "+intrinsic@team_intrinsic.red=rnd", "team_intrinsic.red.cells=7"])
    assert (own.intrinsic, own.team_intrinsic) == (IntrinsicCfg(), {"red": RNDCfg(cells=7)})
    with pytest.raises(ConfigError, match=naming("intrinsic", "'rdn'", "rnd")):
        compose([push, "intrinsic=rdn"])
    with pytest.raises(ConfigError, match=naming("team_intrinsic", "green", "red", "blue")):
        compose([push, "+intrinsic@team_intrinsic.green=rnd"])


@pytest.mark.slow
def test_a_run_with_intrinsic_rewards_is_stored_with_their_type(tmp_path):
    """Every part of the action and every sense of a task are read by the forward model."""
    overrides = [*SMALL, "intrinsic=forward", "body=walker_voice"]
    folder = RunFolder(tmp_path)
    folder.begin(compose_node(overrides), overrides)
    result = run_training(to_config(folder.typed_config()), folder)
    row = result.metrics[-1]
    assert row["agents/intrinsic_return"] != row["agents/return"]
    assert row["agents/intrinsic_loss"] > 0.0
