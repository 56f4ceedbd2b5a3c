import pytest
import torch
from fake_env import make_fake_env
from training import FRAMES, Interrupt, read

from veca_marl.algos.checkpoints import Checkpoints, Identity
from veca_marl.algos.collection.experience import CollectCfg
from veca_marl.algos.evaluation.evaluate import EvalCfg
from veca_marl.algos.reporting import CsvReporter
from veca_marl.algos.specs import team_specs
from veca_marl.algos.training.loop import Trainer
from veca_marl.algos.training.schedule import Budget


@pytest.fixture
def make_trainer(tmp_path, make_ppo):
    def make(name, batches, processes=0, seed=0, reporters=None, **kwargs):
        folder = tmp_path / name
        folder.mkdir(exist_ok=True)
        identity = Identity("Toy", team_specs(make_fake_env(1, 0)))
        return Trainer(
            make_env=make_fake_env,
            learners=make_ppo(seed=seed),
            collect=CollectCfg(2, worlds=2, processes=processes, steps=16),
            evaluation=EvalCfg(every_frames=2 * FRAMES, episodes=2, final_episodes=4, worlds=2),
            budget=Budget(batches * FRAMES, **kwargs),
            checkpoints=Checkpoints(folder / "checkpoints", identity, {}),
            reporters=[CsvReporter(folder)] if reporters is None else reporters,
            seed=seed,
            progress_bar=False,
        )

    return make


def parameters(trainer):
    return torch.cat([p.flatten() for p in trainer.learners.policy.parameters()])


@pytest.mark.slow
@pytest.mark.parametrize("processes", [0, 2], ids=["in_process", "two_processes"])
def test_interrupted_and_resumed_equals_uninterrupted(make_trainer, tmp_path, processes):
    whole = make_trainer("whole", 6, processes)
    lines = whole.run()

    stopped = make_trainer("resumed", 6, processes)
    stopped.reporters = [*stopped.reporters, Interrupt(3 * FRAMES)]
    with pytest.raises(KeyboardInterrupt):
        stopped.run()
    resumed = make_trainer("resumed", 6, processes, reporters=[])
    with torch.no_grad():  # whatever it starts from is replaced
        for p in resumed.learners.policy.parameters():
            p.add_(1.0)
    resumed.resume(resumed.checkpoints.latest())
    assert resumed.progress.frames == 2 * FRAMES
    resumed.reporters = [CsvReporter(tmp_path / "resumed", resumed.progress.frames)]
    assert resumed.run() == lines

    assert torch.equal(parameters(whole), parameters(resumed))
    for mine, other in zip(
        whole.learners.algorithms.values(), resumed.learners.algorithms.values(), strict=True
    ):
        assert mine.schedule.get_last_lr() == other.schedule.get_last_lr()
    for name in ("metrics.csv", "evaluations.csv"):
        assert read(tmp_path / "whole" / name) == read(tmp_path / "resumed" / name)


@pytest.mark.slow
def test_a_larger_budget_after_a_run_that_ended_between_evaluations_is_noted(make_trainer):
    for batches, noted in ((4, False), (3, True)):
        name = f"longer_{batches}"
        make_trainer(name, batches).run()
        resumed = make_trainer(name, 6)
        resumed.resume(resumed.checkpoints.latest())
        notes = [line for line in resumed.run() if "between two evaluations" in line]
        assert bool(notes) is noted


def test_a_resumed_run_reads_its_state_into_main_memory(make_trainer, monkeypatch):
    """A replay buffer is larger than the memory of many devices."""
    make_trainer("run", 2).run()
    resumed, devices = make_trainer("run", 4), []
    load = Checkpoints.load

    def watched(self, path, device):
        devices.append(device)
        return load(self, path, device)

    monkeypatch.setattr(Checkpoints, "load", watched)
    monkeypatch.setattr(resumed.learners, "device", torch.device("meta"))
    resumed.resume(resumed.checkpoints.latest())
    assert devices == [torch.device("cpu")]


def test_interruption_before_the_first_evaluation_can_be_resumed(make_trainer, tmp_path):
    whole = make_trainer("whole", 2)
    whole.run()
    stopped = make_trainer("resumed", 2)
    stopped.reporters = [Interrupt(FRAMES)]
    with pytest.raises(KeyboardInterrupt):
        stopped.run()
    resumed = make_trainer("resumed", 2)
    resumed.resume(resumed.checkpoints.latest())
    resumed.run()
    assert torch.equal(parameters(whole), parameters(resumed))


def test_the_seed_determines_the_parameters(make_trainer):
    runs = {}
    for name, seed in (("a", 1), ("b", 1), ("c", 2)):
        trainer = make_trainer(name, 2, seed=seed)
        trainer.run()
        runs[name] = parameters(trainer)
    assert torch.equal(runs["a"], runs["b"])
    assert not torch.equal(runs["a"], runs["c"])


def test_a_run_writes_a_row_per_batch_and_per_evaluation(make_trainer, tmp_path):
    trainer = make_trainer("run", 5)
    (line,) = trainer.run()
    assert line.startswith("agents: return of policy")
    metrics = read(tmp_path / "run" / "metrics.csv")
    assert [int(row["frames"]) for row in metrics] == [FRAMES * i for i in range(1, 6)]
    for name in ("return", "right", "length", "kl", "clip_fraction", "learning_rate", "entropy"):
        assert all(float(row[f"agents/{name}"]) == float(row[f"agents/{name}"]) for row in metrics)
    evaluations = read(tmp_path / "run" / "evaluations.csv")
    assert [(row["player"], int(row["frames"])) for row in evaluations] == [
        ("random", 0),
        ("policy", 2 * FRAMES),
        ("policy", 4 * FRAMES),
        ("policy", 5 * FRAMES),
    ]
    assert [int(row["episodes"]) for row in evaluations] == [4, 2, 2, 4]
    assert trainer.checkpoints.latest().name == f"frames_{5 * FRAMES:012d}.pt"
    parts = [row.split()[0] for row in trainer.timing().splitlines()]
    assert {"collect", "learn", "transfer", "evaluate", "checkpoint"} < set(parts)


@pytest.mark.slow
def test_time_limit_stops_at_a_checkpoint(make_trainer):
    trainer = make_trainer("run", 1000, max_minutes=1e-9)
    trainer.run()
    assert trainer.progress.frames == 0
    trainer = make_trainer("other", 1000, max_minutes=0.02)
    trainer.run()
    assert 0 < trainer.progress.frames < 1000 * FRAMES
    assert trainer.progress.frames % (2 * FRAMES) == 0
    assert trainer.checkpoints.latest().name == f"frames_{trainer.progress.frames:012d}.pt"
