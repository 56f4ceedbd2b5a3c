"""Self-play: turns, past opponents, and resumption with the same ones."""

import pytest
import torch
from fake_env import make_fake_env
from refusals import naming
from torchrl.envs import ExplorationType, set_exploration_type
from training import FRAMES, SMALL, Interrupt, read

from veca_marl.algos.checkpoints import CheckpointError, Checkpoints, Identity
from veca_marl.algos.collection.experience import CollectCfg
from veca_marl.algos.evaluation.evaluate import EvalCfg
from veca_marl.algos.networks.multisense import MultisenseCfg
from veca_marl.algos.reporting import CsvReporter
from veca_marl.algos.sac import SACCfg
from veca_marl.algos.sac.config import ReplayCfg
from veca_marl.algos.selfplay import Pool, SelfPlay, SelfPlayCfg
from veca_marl.algos.specs import team_specs
from veca_marl.algos.training.learners import TeamLearners
from veca_marl.algos.training.loop import Trainer
from veca_marl.algos.training.schedule import Budget
from veca_marl.algos.transfer import load_actor

TEAMS = ("red", "blue")


def make_env(worlds, seed):
    return make_fake_env(worlds, seed, teams=TEAMS, senses=("audio",))


@pytest.fixture
def make(tmp_path, make_ppo):
    def trainer(name, batches=8, latest=0.5, reporters=None, every=1):
        folder = tmp_path / name
        folder.mkdir(exist_ok=True)
        algorithm = make_ppo(teams=TEAMS, senses=("audio",))
        identity = Identity("Toy", team_specs(make_env(1, 0)))
        return Trainer(
            make_env=make_env,
            learners=algorithm,
            collect=CollectCfg(1, worlds=4, steps=16, processes=0),
            evaluation=EvalCfg(every_frames=every * FRAMES, episodes=2, worlds=2),
            budget=Budget(batches * FRAMES),
            checkpoints=Checkpoints(folder / "checkpoints", identity, {}),
            reporters=[CsvReporter(folder)] if reporters is None else reporters,
            seed=0,
            progress_bar=False,
            matchmaking=SelfPlay(
                SelfPlayCfg(list(TEAMS), latest), algorithm, Pool(folder / "pool"), 0
            ),
        )

    return trainer


def weights(trainer, team):
    actor = trainer.learners.policy.actors[team]
    return torch.cat([p.detach().flatten() for p in actor.parameters()])


def test_teams_learn_in_turns(make):
    trainer = make("turns", batches=1)
    before = {team: weights(trainer, team) for team in TEAMS}
    trainer.run()
    assert (weights(trainer, "red") != before["red"]).any()
    torch.testing.assert_close(weights(trainer, "blue"), before["blue"], rtol=0.0, atol=0.0)
    trainer = make("turns2", batches=2)
    trainer.run()
    assert (weights(trainer, "blue") != before["blue"]).any()


def test_the_pool_stores_the_start_and_the_end_of_every_turn(make, tmp_path):
    make("pool", batches=4).run()
    pool = Pool(tmp_path / "pool" / "pool")
    assert pool.members("red") == [0, FRAMES, 3 * FRAMES]
    assert pool.members("blue") == [0, 2 * FRAMES, 4 * FRAMES]
    assert pool.members("red", until=FRAMES) == [0, FRAMES]
    assert pool.members("green") == []


def test_names_of_teams_may_begin_alike(tmp_path):
    pool = Pool(tmp_path)
    pool.store("red", 0, {})
    pool.store("red_two", 4096, {})
    assert (pool.members("red"), pool.members("red_two")) == ([0], [4096])


def test_the_opponent_plays_its_past_policy(make):
    trainer = make("past", batches=6, latest=0.0)
    trainer.run()
    matches = trainer.matchmaking
    matches.begin_stage(6, 6 * FRAMES)
    assert matches.turn == "red"
    assert matches.past_frames in (0, 2 * FRAMES, 4 * FRAMES, 6 * FRAMES)
    trainer.policy.take_over(trainer.learners.policy)
    matches.load_opponent(trainer.policy)
    past = torch.load(
        matches.pool.folder / f"blue_{matches.past_frames:012d}.pt", weights_only=True
    )
    for name, array in trainer.policy.actors["blue"].state_dict().items():
        torch.testing.assert_close(array, past[name])
    now = trainer.learners.policy.actors["red"].state_dict()
    for name, array in trainer.policy.actors["red"].state_dict().items():
        torch.testing.assert_close(array, now[name])


def test_a_past_opponent_acts_by_its_policy_though_it_would_still_act_at_random(tmp_path):
    """Soft actor-critic acts uniformly until its replay buffer is filled, which a turn may take."""
    cfg = SACCfg(
        network=MultisenseCfg(**{**vars(SMALL), "initial_scale": 0.02}),
        replay=ReplayCfg(capacity=256, warm_up_frames=128),
    )
    learners = TeamLearners(team_specs(make_env(1, 0)), cfg, torch.device("cpu"))
    matches = SelfPlay(SelfPlayCfg(list(TEAMS), 0.0), learners, Pool(tmp_path), 0)
    matches.begin_stage(0, 0)
    policy = learners.policy.copy()
    policy.take_over(learners.policy)
    matches.load_opponent(policy)
    with torch.no_grad(), set_exploration_type(ExplorationType.RANDOM):
        batch = make_env(4, 0).rollout(16, policy.collect, break_when_any_done=False)
    assert (matches.turn, matches.past_frames) == ("red", 0)
    assert batch["red", "action"].std() > 0.5
    assert batch["blue", "action"].std() < 0.2


def test_logs_contain_team_and_age_of_the_opponent(make, tmp_path):
    make("log", batches=6).run()
    rows = read(tmp_path / "log" / "metrics.csv")
    assert [float(row["self_play/turn"]) for row in rows] == [0.0, 1.0] * 3
    met = [row["self_play/opponent_frames"] for row in rows]
    assert "" in met
    assert any(met)
    for row in rows:
        learns, rests = TEAMS if float(row["self_play/turn"]) == 0.0 else TEAMS[::-1]
        assert row[f"{learns}/kl"] != ""
        assert row[f"{rests}/kl"] == ""


@pytest.mark.slow
def test_a_resumed_run_plays_against_the_same_opponents(make, tmp_path):
    make("whole").run()
    with pytest.raises(KeyboardInterrupt):
        make("cut", reporters=[CsvReporter(tmp_path / "cut"), Interrupt(5 * FRAMES)]).run()
    again = make("cut", reporters=[])
    again.resume(again.checkpoints.latest())
    again.reporters = [CsvReporter(tmp_path / "cut", again.progress.frames)]
    again.run()
    for kind in ("metrics", "evaluations"):
        one, other = (read(tmp_path / name / f"{kind}.csv") for name in ("whole", "cut"))
        assert one == other


def test_a_frozen_opponent_has_the_parameters_of_another_run(make, tmp_path):
    trainer = make("other", batches=2)
    trainer.run()
    spec = team_specs(make_env(1, 0))["blue"]
    actor = load_actor(tmp_path / "other", "blue", spec)
    learnt = trainer.learners.policy.actors["blue"].state_dict()
    for name, array in actor.state_dict().items():
        torch.testing.assert_close(array, learnt[name])
    assert not any(p.requires_grad for p in actor.parameters())


def test_a_checkpoint_of_another_format_raises_an_error(make, tmp_path):
    make("other", batches=1).run()
    path = Checkpoints(tmp_path / "other" / "checkpoints", None, {}).latest()
    torch.save(torch.load(path, weights_only=True) | {"format": 1}, path)
    with pytest.raises(CheckpointError, match=naming(path, "format 1", "format 3")):
        load_actor(path, "blue", team_specs(make_env(1, 0))["blue"])


def test_opponents_that_cannot_be_loaded_are_named(make, tmp_path):
    make("other", batches=1).run()
    spec = team_specs(make_env(1, 0))["blue"]
    with pytest.raises(CheckpointError, match=naming("'green'", "'blue'", "'red'")):
        load_actor(tmp_path / "other", "green", spec)
    with pytest.raises(CheckpointError, match=naming("specs", "observations")):
        load_actor(tmp_path / "other", "blue", team_specs(make_fake_env(1, 0))["agents"])
    with pytest.raises(CheckpointError, match=naming(tmp_path / "nothing")):
        load_actor(tmp_path / "nothing", "blue", spec)


@pytest.mark.parametrize("teams", [["red"], ["red", "red"], ["a", "b", "c"]])
def test_self_play_needs_two_teams(teams):
    with pytest.raises(ValueError, match=naming(f"self_play.teams={teams}")):
        SelfPlayCfg(teams)


def test_self_play_needs_teams_that_learn(make_ppo, tmp_path):
    algorithm = make_ppo(teams=TEAMS)
    with pytest.raises(ValueError, match=naming("self_play.teams", "green", "blue", "red")):
        SelfPlay(SelfPlayCfg(["red", "green"]), algorithm, Pool(tmp_path), 0)


@pytest.mark.parametrize(
    ("damage", "parts"),
    [
        (lambda path: path.write_bytes(path.read_bytes()[:99]), ("cut off",)),
        (lambda path: torch.save({"x": torch.zeros(1)}, path), ("RuntimeError",)),
        (lambda path: path.unlink(), ("exist",)),
    ],
)
def test_past_policies_that_cannot_be_loaded_are_named(make, damage, parts):
    trainer = make("run", latest=0.0)
    matches = trainer.matchmaking
    matches.begin_stage(0, 0)
    path = matches.pool.folder / f"blue_{0:012d}.pt"
    damage(path)
    with pytest.raises(CheckpointError, match=naming(path, *parts)):
        matches.load_opponent(trainer.policy)


def test_a_pool_that_was_removed_is_named(make):
    with pytest.raises(CheckpointError, match=naming("pool", "'blue'")):
        make("run", latest=0.0).matchmaking.begin_stage(2, 2 * FRAMES)
