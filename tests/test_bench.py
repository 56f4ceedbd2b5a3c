"""The benchmark: the stopwatch, the command, free play and the references."""

import json
from functools import partial
from itertools import count
from multiprocessing import active_children, get_context

import numpy as np
import pytest
import torch
from composed import compose
from paths import ROOT
from refusals import naming

from veca_marl.algos.checkpoints import Checkpoints
from veca_marl.bench.body_views import body_views
from veca_marl.bench.command import BenchCfg, chosen_games, free_play, main
from veca_marl.bench.learning import SimultaneousRollouts
from veca_marl.bench.references import (
    as_visual_shapes,
    busy_room,
    measure_ears,
    tiny_view,
    touched_child,
)
from veca_marl.bench.rollouts import measure_rollouts, most_views
from veca_marl.bench.stopwatch import Probes, Stopwatch
from veca_marl.config import conf_dir
from veca_marl.envs.adapters.torchrl.env import VecaEnv
from veca_marl.envs.core.game import Game
from veca_marl.envs.core.task import TASKS
from veca_marl.override_text import quoted
from veca_marl.processes.supervision import WorkerError
from veca_marl.sim.physics import PlaygroundCfg, World
from veca_marl.sim.vision import Camera

QUICK = ["bench.steps=3", "bench.repeats=1"]
ROLLOUTS = [*QUICK, "bench.worlds=[1]", "bench.references=false"]

BELOW_A_FILE = quoted(f"{__file__}/bench.json")


EXPERIMENTS = sorted(path.stem for path in (conf_dir() / "experiment").glob("*.yaml"))


@pytest.fixture(autouse=True)
def _threads_as_before():
    threads = torch.get_num_threads()
    yield
    torch.set_num_threads(threads)


class HandClock:
    """A clock that a test sets; reading it takes no time."""

    def __init__(self):
        self.now = 0

    def __call__(self):
        return self.now


def test_nested_parts_are_counted_once_and_sum_up():
    clock = HandClock()
    watch = Stopwatch("rest", clock)

    def spend(nanoseconds):
        clock.now += nanoseconds

    inner = watch.wrap("inner", lambda: spend(100))

    def outer():
        spend(10)
        inner()
        spend(20)

    with watch.running():
        spend(1)
        watch.wrap("outer", outer)()
        spend(2)
    assert watch.nanoseconds == {"rest": 3, "outer": 30, "inner": 100}


def test_nothing_is_counted_while_the_stopwatch_is_not_running():
    clock = count(step=1000)
    watch = Stopwatch("rest", lambda: next(clock))
    assert watch.wrap("part", lambda x: x + 1)(1) == 2
    assert not watch.nanoseconds


def test_an_error_inside_a_part_ends_the_part():
    clock = HandClock()
    watch = Stopwatch("rest", clock)

    def fail():
        clock.now += 5
        raise KeyError("x")

    with watch.running():
        with pytest.raises(KeyError):
            watch.wrap("part", fail)()
        clock.now += 7
    assert watch.nanoseconds == {"part": 5, "rest": 7}


def test_the_time_of_reading_the_clock_is_subtracted():
    ticks = count(step=40)  # each reading takes 40 ns, nothing else takes any time
    watch = Stopwatch("rest", lambda: next(ticks))
    with watch.running():
        watch.wrap("part", lambda: None)()
    assert watch.nanoseconds == {"rest": 0, "part": 0}


def test_probes_leave_no_trace():
    class Thing:
        def act(self):
            return "done"

    thing, watch = Thing(), Stopwatch("rest")
    with Probes(watch) as probes:
        probes.put("acting", thing, "act")
        with watch.running():
            assert thing.act() == "done"
        assert "act" in vars(thing)
    assert "act" not in vars(thing)
    assert watch.nanoseconds["acting"] > 0


@pytest.mark.slow
def test_results_as_tables_and_json(tmp_path, capsys):
    file = tmp_path / "bench.json"
    words = ["+task=KickTheBall", "bench.worlds=[1,2]", f"bench.json={file}"]
    assert main([*QUICK, *words]) == 0
    printed = capsys.readouterr().out
    found = json.loads(file.read_text())
    assert [run["worlds"] for run in found["rollouts"]] == [1, 2]
    for run in found["rollouts"]:
        parts = run["ms_per_part"]
        assert {"physics", "vision", "audio", "task", "VecaEnv", "TorchRL"} <= set(parts)
        assert all(ms > 0 for ms in parts.values())
        rest = parts["task"] + parts["VecaEnv"] + parts["policy"] + parts["TorchRL"]
        assert run["overhead"] == pytest.approx(rest / sum(parts.values()))
        assert run["agent_steps_per_reference"] > 0
        assert 0.05 < run["views_per_agent_step"] < 20.0
        assert f"{run['agent_steps_per_s']:,.0f}" in printed
    eye = found["references"]["eye"]
    assert eye["speed_ratio"] == pytest.approx(eye["tiny_ms"] / eye["ours_ms"], rel=0.5)
    assert found["references"]["ears_ms"] > 0
    skin = found["references"]["skin"]
    assert skin["skinning_ms"] > 0
    assert skin["touch_ms"]["20"] > skin["touch_ms"]["0"] > 0
    single = [eye["ours_ms"], eye["tiny_ms"], skin["distant_ms"]]
    for ms in (*single, *found["references"]["body"].values()):
        assert 0 < ms < np.inf
        assert f" {ms:.3f}\n" in printed
    assert found["machine"]["cores"] >= 1
    assert (found["machine"]["commit"] or "unknown") in printed.splitlines()[0]


@pytest.mark.slow
@pytest.mark.parametrize("every_frames", [16, 20])  # a batch has 16
def test_learning_is_measured_beside_rollouts(every_frames, tmp_path, capsys, monkeypatch):
    written = []
    save = Checkpoints.save
    monkeypatch.setattr(Checkpoints, "save", lambda *args: written.append(save(*args)))
    file = tmp_path / "bench.json"
    words = ["+task=KickTheBall", "senses/vision=blind", "task.max_seconds=0.4", "threads=1"]
    words += ["collect=one_process", "collect.worlds=2", "collect.steps=8"]
    words += [f"eval.every_frames={every_frames}"]
    words += ["eval.episodes=1", "eval.worlds=1", f"bench.json={file}"]
    assert main([*QUICK, "bench.learning=true", "bench.stages=2", *words]) == 0
    found = json.loads(file.read_text())["learning"]
    assert found["algorithm"] == "ppo"
    assert {"collect", "learn", "evaluate", "checkpoint"} <= set(found["seconds"])
    assert len(set(written)) == 4, "one at the start, one at the end of each stage"
    assert None not in written
    assert not any(path.exists() for path in written), "the folder is temporary"
    speeds = found["frames_per_s"] / found["rollout_per_s"] / found["cores"]
    assert 0.0 < found["ratio"] < 1.0
    assert found["ratio"] == pytest.approx(speeds, rel=1.0), "both are medians of the same turns"
    assert 0.0 < found["processor_ratio"] < 1.0, "learning costs more than a rollout alone"
    assert 0.0 < found["ratio_at_once"] < 1.0, "one process learns, all cores roll out"
    assert f"{found['ratio']:.2f}" in capsys.readouterr().out


def measure_without(process, rollouts):
    process.kill()
    return rollouts.frames_per_s()


@pytest.mark.slow
def test_rollouts_at_once_name_a_process_that_was_killed():
    game = compose(["+task=KickTheBall", "senses/vision=blind"]).game
    before = set(active_children())
    rollouts = SimultaneousRollouts(partial(VecaEnv, game, 1, seed=0), steps=2, processes=1)
    assert rollouts.frames_per_s() > 0.0
    # shared memory that this process asks for is not that in which the others wait for each other
    shared = [get_context("spawn").Array("i", [7] * 8, lock=False) for _ in range(8)]
    assert rollouts.frames_per_s() > 0.0
    assert all(list(array) == [7] * 8 for array in shared)
    (process,) = set(active_children()) - before
    with pytest.raises(WorkerError, match=naming("SIGKILL")):
        measure_without(process, rollouts)
    rollouts.close()


@pytest.mark.parametrize(("things", "distant"), [(0, 0), (3, 0), (3, 20)])
def test_the_measured_skin_senses_each_prop_and_nothing_else(things, distant):
    world, sense = touched_child(PlaygroundCfg(), things, distant)
    felt = (sense.update_taxels() > 0.0).any(axis=1)
    vertices = world.scene.meshes.vertices
    middles = vertices[world.scene.meshes.triangles].mean(axis=1)
    balls = np.array([world.prop(f"ball_{i}").position for i in range(things)]).reshape(-1, 3)
    corners = vertices[world.scene.meshes.triangles] - middles[:, None]
    reach = 0.035 + np.linalg.norm(corners, axis=-1).max(axis=1)  # radius of a ball, and a margin
    near = np.linalg.norm(middles[:, None] - balls[None], axis=-1) < reach[:, None]
    assert (felt[:, None] & near).any(axis=0).all()
    assert not (felt & ~near.any(axis=1)).any()
    world.close()


def test_the_measured_views_show_a_body_from_outside_twice_and_from_its_own_eye():
    world = World(PlaygroundCfg())
    skin, bones, own = (render().ids[0] for render in body_views(world))
    child = world.scene.find("child").id
    world.close()
    for ids in (skin, bones, own):
        assert set(np.unique(ids)) == {-1, child}
        assert 0.01 < np.mean(ids == child) < 0.5
    assert np.mean(skin == bones) > 0.95
    assert not np.array_equal(skin, bones)


@pytest.mark.slow
def test_an_absent_sense_is_not_measured(tmp_path):
    file = tmp_path / "bench.json"
    words = ["+task=KickTheBall", "senses/audio=deaf", "playground=simple", f"bench.json={file}"]
    assert main([*ROLLOUTS, *words]) == 0
    found = json.loads(file.read_text())
    assert found["references"] is None
    [run] = found["rollouts"]
    assert run["playground"] == "simple"
    assert "audio" not in run["ms_per_part"]
    assert "vision" in run["ms_per_part"]


@pytest.mark.slow
@pytest.mark.parametrize("task", ["TurnBaby", "SoccerTwoPlayer", "MultiAgentNav"])
def test_tasks_with_any_body_and_number_of_agents_are_measured(task, capsys):
    assert main([*ROLLOUTS, f"+task={task}"]) == 0
    assert task in capsys.readouterr().out


@pytest.mark.slow
def test_several_tasks_and_playgrounds_are_one_table(capsys):
    words = [*ROLLOUTS, "bench.tasks=[KickTheBall]", "bench.playgrounds=[simple,house]"]
    assert main(words) == 0
    rows = [line for line in capsys.readouterr().out.splitlines() if line.startswith("| ")]
    assert [row.split(" | ")[:2] for row in rows[2:]] == [
        ["| KickTheBall", "`simple`"],
        ["| KickTheBall", "`house`"],
    ]
    for row, most in zip(rows[2:], (0.8, 1.2), strict=True):
        view_ms, views, goal = row.strip(" |").split(" | ")[-3:]
        assert 0.1 < float(view_ms) < 1000.0
        assert goal == f"{most}: {'met' if float(views) <= most else 'missed'}"


@pytest.mark.slow
def test_tasks_are_measured_with_each_number_of_worlds(capsys):
    words = ["bench.tasks=[ObjectNav]", "bench.worlds=[2,3]", "senses/touch=numb"]
    assert main([*ROLLOUTS, *words]) == 0
    rows = [line for line in capsys.readouterr().out.splitlines() if line.startswith("| ")]
    column = rows[0].split(" | ").index("worlds")
    assert [row.split(" | ")[column] for row in rows[2:]] == ["2", "3"]


@pytest.mark.slow
def test_of_all_tasks_those_are_measured_that_fit_a_playground(capsys, monkeypatch):
    monkeypatch.setattr("veca_marl.bench.command.TASKS", ("MultiAgentNav", "ObjectNav"))
    games = chosen_games(BenchCfg(tasks=["all"], playgrounds=["simple", "house"]), [])
    assert [(game.task.name, game.playground.name) for game in games] == [
        ("MultiAgentNav", "house"),
        ("ObjectNav", "simple"),
        ("ObjectNav", "house"),
    ]
    assert "left out: MultiAgentNav in simple: task.agents=2 start" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("task", "most"), [("TurnBaby", None), ("ObjectNav", 0.8), ("BabyzumasRevenge", 1.2)]
)
def test_walkers_have_a_goal_in_views_that_is_greater_in_several_rooms(task, most):
    game = Game(compose([f"+task={task}"]).game)
    assert most_views(game) == most
    game.close()


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (["bench.tasks=[KickTheBall]", "bench.agents=[2]"], ("bench.tasks",)),
        (["bench.playgrounds=[house]", "+task=KickTheBall"], ("bench.playgrounds", "bench.tasks")),
        (["bench.tasks=[Kick]"], ("'Kick'",)),
        (["bench.tasks=[all]", "bench.playgrounds=[garden]"], ("garden", "single_room")),
        (
            ["bench.tasks=[MultiAgentNav]", "bench.playgrounds=[simple]"],
            ("task.agents=2", "'simple'", "two_rooms"),
        ),
    ],
)
def test_impossible_tables_are_refused(words, parts, capsys):
    assert main([*ROLLOUTS, *words]) == 2
    error = capsys.readouterr().err
    assert all(part in error for part in parts)


@pytest.mark.slow
@pytest.mark.parametrize("task", sorted(TASKS))
def test_every_task_is_measured(task, capsys):
    assert main([*ROLLOUTS, f"+task={task}"]) == 0
    assert task in capsys.readouterr().out


BODIES = sorted(path.stem for path in (conf_dir() / "body").glob("*.yaml"))


@pytest.mark.slow
@pytest.mark.parametrize(
    "body", [pytest.param(b, marks=[pytest.mark.slow] * (b != "mitten")) for b in BODIES]
)
def test_every_body_is_measured_in_free_play(body, capsys):
    words = ["+task=ObjectNav", f"body={body}", "bench.agents=[2]"]
    assert main([*ROLLOUTS, *words, "bench.senses=[touch,proprioception]"]) == 0
    assert "FreePlay2" in capsys.readouterr().out


@pytest.mark.slow
@pytest.mark.parametrize("name", EXPERIMENTS)
def test_every_experiment_is_measured(name, capsys):
    assert main([*ROLLOUTS, f"+experiment={name}"]) == 0
    assert "agent steps/s" in capsys.readouterr().out


@pytest.mark.slow
def test_an_experiment_with_a_scripted_opponent_is_measured(capsys):
    assert main([*ROLLOUTS, "+experiment=soccer"]) == 0
    assert "SoccerTwoPlayer" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (["+task=Kick"], ("'Kick'", "KickTheBall")),
        ([], ("+task=NAME", "KickTheBall")),
        (["+task=KickTheBall", "senses/audio=nono"], ("nono", "hrtf")),
        (["+task=KickTheBall", "playground=garden"], ("garden", "single_room")),
        (["+task=KickTheBall", "bench.worlds=[0]"], ("bench.worlds", "[0]")),
        (["+task=KickTheBall", "bench.worlds=[two]"], ("bench.worlds[0]", "'two'")),
        (["+task=KickTheBall", "bench.wolds=[1]"], ("bench.wolds", "worlds")),
        (["+task=KickTheBall", f"bench.json={BELOW_A_FILE}"], ("bench.json", __file__)),
        (["+task=KickTheBall", f"bench.json={quoted(ROOT)}"], ("bench.json", str(ROOT))),
        (
            ["bench.tasks=[KickTheBall]", "senses/vision=blind", "senses/audio=deaf"],
            ("sense", "vision", "audio"),
        ),
        (["+task=KickTheBall", "bench.loose_props=3"], ("bench.loose_props", "bench.agents")),
        (
            ["+task=KickTheBall", "bench.learning=true", "bench.agents=[2]"],
            ("bench.agents", "bench.learning=true"),
        ),
        (["+task=TurnBaby", "body=walker"], ("joints", "body=full")),
        (
            ["+task=KickTheBall", "playground=simple", "bench.agents=[99]"],
            ("99", "'simple'"),
        ),
    ],
)
def test_a_wrong_choice_ends_in_one_line(words, parts, capsys):
    assert main([*ROLLOUTS, *words]) == 2
    error = capsys.readouterr().err
    assert all(part in error for part in parts)
    assert error.count("\n") == 1


def test_free_play_has_the_number_of_agents_asked_for_and_is_unregistered_afterwards():
    before = dict(TASKS)
    game = compose(["+task=KickTheBall", "senses/vision=blind"]).game
    with free_play(game, 3) as played:
        env = VecaEnv(played, seed=0)
        rollout = env.rollout(3)
        env.close()
    assert rollout["next", "agents", "observation", "audio"].shape == (1, 3, 3, 2, 250)
    assert rollout["next", "agents", "reward"].abs().max() > 0
    assert before == dict(TASKS)


def test_tiny_renderer_draws_the_scene_that_we_draw():
    world, watcher = busy_room(compose(["+task=KickTheBall"]).game.playground)
    hidden = world.scene.hidden(watcher.object_id, watcher.own_head_frames)
    eye, camera = watcher.mount("eye_left"), Camera()
    client, objects_of = as_visual_shapes(world.scene, hidden)
    _, bodies = tiny_view(client, camera, eye)
    client.close()
    objects = np.array([*objects_of, -1])  # -1, the sky, is the last one
    theirs = objects[np.reshape(bodies, (camera.height, camera.width))]
    ours = camera.render(world.scene, [eye], hidden).ids[0]
    world.close()
    assert len(np.unique(ours)) >= 8
    assert np.mean(ours == theirs) > 0.94


@pytest.mark.slow
def test_the_step_goes_to_physics_and_senses_and_the_ears_are_quick():
    game = compose(["+task=KickTheBall"]).game
    run = measure_rollouts(game, worlds=4, steps=100, repeats=5)
    assert run.overhead < 0.3  # the goal is 0.25; the rest is for busy machines
    assert run.build_s < 1.0
    assert measure_ears(game.playground, steps=200) < 0.5
