"""Collect, learn, evaluate, keep: in stages, each of which depends on (seed, stage) alone.

A stage ends with an evaluation and a checkpoint, and the next one starts new episodes and new
random streams from (seed, stage). A checkpoint therefore holds only what was learnt: a run resumed
from it, after Ctrl-C, a crash or a power cut, continues as if it had never stopped, bit for bit.
What an interrupted stage had learnt is learnt again.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from contextlib import closing
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from torchrl.envs import EnvBase
from tqdm import tqdm

from veca_marl.algos.ppo.ppo import PPO
from veca_marl.algos.selfplay.self_play import AllLearn, Matchmaking
from veca_marl.algos.specs import EnvFactory
from veca_marl.algos.training.checkpoint import Checkpoints, load_checkpoint
from veca_marl.algos.training.collect import CollectCfg, Experience
from veca_marl.algos.training.evaluation import (
    EvalCfg,
    Exploration,
    Scores,
    comparison_line,
    evaluate,
    interval,
    random_policy,
)
from veca_marl.algos.training.metrics import Reporter, Stopwatch, TrainingEpisodes

_EVALUATION_STAGE = 2**31 - 1  # in place of a stage number: starts no training stage ever uses


@dataclass
class Budget:
    """How long to train.

    Attributes:
        total_frames: Frames of experience (rounded up to whole batches).
        max_minutes: Also stop after the stage in which this time runs out; None for no limit.
    """

    total_frames: int
    max_minutes: float | None = None


@dataclass
class Progress:
    """Where a run stands; stored in its checkpoints.

    Attributes:
        stage: Finished stages.
        iteration: Finished batches.
        frames: Frames learnt from.
        best_return: Best mean return of the evaluations, over all teams.
    """

    stage: int = 0
    iteration: int = 0
    frames: int = 0
    best_return: float = -math.inf


@dataclass
class Trainer:
    """Trains an algorithm.

    Attributes:
        make_env: Makes the worlds.
        algorithm: Learns.
        collect: How experience is gathered.
        evaluation: When and how the policy is evaluated.
        budget: How long.
        checkpoints: Where states are kept.
        reporters: Where numbers go.
        seed: Everything random follows from it.
        progress_bar: Whether to show one.
        matchmaking: Who learns against whom.
        progress: Where the run stands.
        watch: Where the time goes.
        player: The copy of the policy that plays, on the CPU.
    """

    make_env: EnvFactory
    algorithm: PPO
    collect: CollectCfg
    evaluation: EvalCfg
    budget: Budget
    checkpoints: Checkpoints
    reporters: Sequence[Reporter]
    seed: int
    progress_bar: bool = True
    matchmaking: Matchmaking = field(default_factory=AllLearn)
    progress: Progress = field(default_factory=Progress)
    watch: Stopwatch = field(default_factory=Stopwatch)
    _resumed_frames: int = 0

    def __post_init__(self) -> None:
        self.player = self.algorithm.copy_policy()

    def resume(self, path: Path) -> None:
        """Take up learning and progress from the checkpoint at `path`."""
        state = load_checkpoint(path, self.checkpoints.identity, self.algorithm.device)
        self.algorithm.load_state_dict(state["algorithm"])
        self.algorithm.refresh(self.player)
        self.progress = Progress(**state["progress"])
        self._resumed_frames = self.progress.frames

    def run(self) -> list[str]:
        """Train until the budget is spent; return how each team compares with random play."""
        fresh = self.progress.frames == 0
        if fresh:
            self._save(best=False)  # an interruption at any time finds something to resume from
        with self.watch.measure("build"):
            eval_env = self.make_env(self.evaluation.worlds, 0)
            experience = Experience(self.make_env, self.player, self.collect)
        with closing(eval_env), closing(experience):
            with self.watch.measure("evaluate"):
                baseline = self._play(eval_env, random_policy(eval_env), Exploration.stochastic)
            if fresh:
                self._report_scores("random", baseline)
            scores = self._train(experience, eval_env) or self._play(eval_env)
        return [comparison_line(team, scores[team], baseline[team]) for team in scores]

    def _train(self, experience: Experience, eval_env: EnvBase) -> dict[str, Scores] | None:
        """Go through all stages and return the scores of the last, if there was one."""
        scores = None
        with tqdm(
            total=self._iterations() * self.collect.frames,
            initial=self.progress.frames,
            unit=" frames",
            disable=not self.progress_bar,
        ) as bar:
            while self.progress.iteration < self._iterations() and not self._out_of_time():
                self._run_stage(experience, bar)
                scores = self._end_stage(eval_env)
        return scores

    def timing(self) -> str:
        """Return a table of where the time went."""
        return self.watch.table(self.progress.frames - self._resumed_frames)

    def _run_stage(self, experience: Experience, bar: tqdm[Any]) -> None:
        self.matchmaking.begin_stage(self.progress.stage, self.progress.frames)
        self._equip(experience)
        with self.watch.measure("collect"):
            experience.restart(_seed(self.seed, self.progress.stage))
        episodes = TrainingEpisodes()
        per_stage = math.ceil(self.evaluation.every_frames / self.collect.frames)
        until = min(self.progress.iteration + per_stage, self._iterations())
        while self.progress.iteration < until:
            row = self._iterate(experience, episodes)
            bar.update(self.collect.frames)
            finished = {k: v for k, v in row.items() if k.endswith("/return") and v == v}
            if finished:  # episodes: the bar keeps their last mean returns
                bar.set_postfix({k: f"{v:.3g}" for k, v in finished.items()})

    def _iterate(self, experience: Experience, episodes: TrainingEpisodes) -> dict[str, float]:
        before = self.watch.elapsed_s
        with self.watch.measure("collect"):
            batch = experience.collect()
        with self.watch.measure("advantage"):
            rows = self.algorithm.prepare(batch)
        with self.watch.measure("update"):
            measured = self.algorithm.learn(rows)
        with self.watch.measure("transfer"):
            self._equip(experience)
        self.progress.iteration += 1
        self.progress.frames += self.collect.frames
        row: dict[str, float] = {"iteration": self.progress.iteration}
        for team, measures in measured.items():
            both = episodes.add(batch, team) | measures
            row |= {f"{team}/{name}": value for name, value in both.items()}
        row |= self.matchmaking.note()
        row["frames_per_s"] = self.collect.frames / (self.watch.elapsed_s - before)
        for reporter in self.reporters:
            reporter.write("metrics", self.progress.frames, row)
        return row

    def _equip(self, experience: Experience) -> None:
        """Let the worlds be played by what was learnt, and by whom it is to meet."""
        self.algorithm.refresh(self.player)
        self.matchmaking.dress(self.player)
        experience.update_policy()

    def _end_stage(self, eval_env: EnvBase) -> dict[str, Scores]:
        self.algorithm.refresh(self.player)
        with self.watch.measure("evaluate"):
            scores = self._play(eval_env)
        self._report_scores("policy", scores)
        mean = float(np.mean([s.returns.mean() for s in scores.values()]))
        best = mean > self.progress.best_return
        self.progress.best_return = max(mean, self.progress.best_return)
        self.progress.stage += 1
        self.matchmaking.end_stage(self.progress.frames)
        with self.watch.measure("checkpoint"):
            self._save(best)
        return scores

    def _save(self, best: bool) -> None:
        state = {"algorithm": self.algorithm.state_dict(), "progress": asdict(self.progress)}
        self.checkpoints.save(state, self.progress.frames, best)

    def _play(
        self, env: EnvBase, policy: Any = None, exploration: Exploration | None = None
    ) -> dict[str, Scores]:
        return evaluate(
            env,
            policy or self.player,
            self.evaluation.episodes,
            _seed(self.seed, _EVALUATION_STAGE),
            exploration or self.evaluation.exploration,
        )

    def _report_scores(self, who: str, scores: dict[str, Scores]) -> None:
        for team, score in scores.items():
            low, high = interval(score.returns)
            row: dict[str, float | int | str] = {
                "player": who,
                "team": team,
                "episodes": len(score.returns),
                "return": float(score.returns.mean()),
                "return_low": low,
                "return_high": high,
                "length": float(score.lengths.mean()),
                **{name: float(values.mean()) for name, values in score.terms.items()},
            }
            for reporter in self.reporters:
                reporter.write("evaluations", self.progress.frames, row)

    def _iterations(self) -> int:
        return math.ceil(self.budget.total_frames / self.collect.frames)

    def _out_of_time(self) -> bool:
        limit = self.budget.max_minutes
        return limit is not None and self.watch.elapsed_s > 60.0 * limit


def _seed(seed: int, stage: int) -> int:
    """Return an independent 31-bit seed for each pair."""
    return int(np.random.SeedSequence([seed, stage]).generate_state(1)[0] >> 1)
