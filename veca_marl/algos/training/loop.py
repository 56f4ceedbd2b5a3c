"""The training loop: collect, learn, evaluate, store; in stages that depend on (seed, stage) alone.

A stage ends with an evaluation (but a short first one) and a checkpoint, and the next one starts
new episodes and new random streams from (seed, stage). A checkpoint therefore holds only what was
learnt, and the means of the last episodes: where every
algorithm has `Algorithm.exact_resume`, a run that is resumed from it (after Ctrl-C, a crash or a
power cut) gives the same parameters, bit for bit, as a run that was not interrupted. What an
interrupted stage had learnt is learnt again.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from contextlib import ExitStack, closing
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Any

import torch
from numpy.typing import NDArray
from tensordict import TensorDictBase
from torchrl import timeit

from veca_marl.algos.checkpoints import Checkpoints, load_errors, to_plain
from veca_marl.algos.collection.experience import CollectCfg, Experience, NoExperience
from veca_marl.algos.evaluation.comparison import comparison_line, score_rows
from veca_marl.algos.evaluation.episodes import TrainingEpisodes, stored_means
from veca_marl.algos.evaluation.evaluate import EvalCfg, Scores
from veca_marl.algos.evaluation.evaluators import (
    Evaluator,
    Players,
    Request,
    make_evaluator,
    nothing,
)
from veca_marl.algos.policy import Policy
from veca_marl.algos.reporting import Reporter
from veca_marl.algos.seeds import derived_seed
from veca_marl.algos.specs import EnvFactory, TeamSpec, action_key
from veca_marl.algos.training.finite import (
    check_batch,
    check_scores,
    check_state,
    check_stored,
    warn_of_ranges,
)
from veca_marl.algos.training.learners import AllLearn, Matchmaking, TeamLearners
from veca_marl.algos.training.schedule import (
    Budget,
    Progress,
    ProgressDisplay,
    Schedule,
    Stopwatch,
    device_memory,
    timing_table,
)
from veca_marl.processes.cores import usable_cores

_EVALUATION_STAGE = 2**31 - 1  # in place of a stage number: seeds that no training stage uses


def evaluation_seed(seed: int) -> int:
    """Return the seed of the episodes of all evaluations of a run with the seed `seed`."""
    return derived_seed(seed, _EVALUATION_STAGE)


def _actions(batch: TensorDictBase, specs: Mapping[str, TeamSpec]) -> dict[str, NDArray[Any]]:
    """Return all actions of a batch, by team and part."""
    return {
        "/".join(["actions", *key]): batch[key].numpy(force=True)
        for team, spec in specs.items()
        for key in (action_key(team, part) for part in spec.actions)
    }


@dataclass(frozen=True)
class Evaluations:
    """Plays the evaluations of a run; all of them begin with the same episodes.

    Each method returns the scores of each team, and raises `NotFiniteError` if one is not finite.

    Attributes:
        evaluator: Plays the episodes.
        cfg: Numbers of episodes, and whether actions are sampled.
        seed: Seed of the run.
    """

    evaluator: Evaluator
    cfg: EvalCfg
    seed: int

    def play_baseline(self) -> dict[str, Scores]:
        """Play the episodes of the last evaluation with random actions."""
        return self._play("random", self.cfg.last_episodes)

    def play(self) -> dict[str, Scores]:
        """Play the evaluation of the policy after a stage that is not the last."""
        return self._play("policy", self.cfg.episodes)

    def play_last(self, meanwhile: Callable[[], None]) -> dict[str, Scores]:
        """Play the last evaluation of the policy; call `meanwhile` once, see `Evaluator`."""
        return self._play("policy", self.cfg.last_episodes, meanwhile)

    def _play(
        self, player: str, episodes: int, meanwhile: Callable[[], None] = nothing
    ) -> dict[str, Scores]:
        request = Request(player, episodes, evaluation_seed(self.seed), self.cfg.exploration)
        with timeit("evaluate"):
            scores = self.evaluator.play(request, meanwhile)
        check_scores(scores)
        return scores


@dataclass
class Trainer:
    """Trains the teams of an environment.

    Attributes:
        make_env: Makes the environments.
        learners: The algorithms of all teams.
        collect: How experience is gathered.
        evaluation: When and how the policy is evaluated.
        budget: How long.
        checkpoints: Where states are stored.
        reporters: Where numbers go.
        seed: Determines all random numbers.
        progress_bar: Whether to show one; where it is no terminal, a line after each stage.
        episode_steps: Steps after which an episode is truncated; None if that is not known.
        matchmaking: Which teams learn against which opponents.
        make_training_env: Makes those in which experience is collected; None is `make_env`.
        during_last_evaluation: Called once, while other processes play the last evaluation; it
            may act with `policy`.
        progress: Where the run stands.
        policy: A copy of the policy on the CPU, which collects and is evaluated.
    """

    make_env: EnvFactory
    learners: TeamLearners
    collect: CollectCfg
    evaluation: EvalCfg
    budget: Budget
    checkpoints: Checkpoints
    reporters: Sequence[Reporter]
    seed: int
    progress_bar: bool = True
    episode_steps: int | None = None
    matchmaking: Matchmaking = field(default_factory=AllLearn)
    make_training_env: EnvFactory | None = None
    during_last_evaluation: Callable[[], None] = nothing
    progress: Progress = field(default_factory=Progress)
    _resumed_frames: int = 0
    _resumed_within_stage: bool = False
    _evaluations: Evaluations = field(init=False)
    _episodes: TrainingEpisodes = field(default_factory=TrainingEpisodes)

    def __post_init__(self) -> None:
        self.policy: Policy = self.learners.policy.copy()
        timeit.erase()
        self._clock = timeit("total").start()
        self._stopwatch = Stopwatch(self._clock.elapsed)

    def resume(self, path: Path) -> None:
        """Continue learning and progress from the checkpoint at `path`."""
        # modules and optimisers copy to their device; a replay buffer stays in main memory
        state = self.checkpoints.load(path, torch.device("cpu"))
        self.checkpoints.remove_old()
        with load_errors(path):
            check_stored({key: state[key] for key in ("algorithm", "intrinsic")})
            self.learners.load_state_dict(state["algorithm"])
            self.learners.load_intrinsic_state(state["intrinsic"])
            self.progress = Progress.stored(state["progress"])
            self._episodes.last = stored_means(state["episodes"])
        self.policy.take_over(self.learners.policy)
        self._resumed_frames = self.progress.frames
        within_stage = self.schedule.is_within_stage(self.progress.iteration)
        self._resumed_within_stage = within_stage and not self._is_finished()

    def run(self) -> list[str]:
        """Train until the budget is spent.

        Returns:
            A line that compares the team that learns with random actions, and a line for each
            property of the run that its user should know.
        """
        fresh = self.progress.frames == 0
        if fresh:
            self._save(best=False)  # an interruption at any time finds a checkpoint
        with ExitStack() as pending:
            with timeit("build"):
                evaluator = pending.enter_context(closing(self._make_evaluator()))
                experience = pending.enter_context(closing(self._make_experience()))
            self._evaluations = Evaluations(evaluator, self.evaluation, self.seed)
            baseline = self._evaluations.play_baseline()
            if fresh:
                self._report_scores("random", baseline)
            scores = self._train(experience)
            if scores is None:
                scores = self._evaluations.play_last(self.during_last_evaluation)
        return [*self._compared(scores, baseline), *self._notes()]

    def _compared(self, scores: Mapping[str, Scores], baseline: Mapping[str, Scores]) -> list[str]:
        """Return a line that compares the team that learns with random actions.

        In the baseline all teams that learn act at random: of several, none met the same opponents.
        """
        if len(self.learners.algorithms) > 1:
            return []
        return [comparison_line(t, scores[t], baseline[t]) for t in self.learners.algorithms]

    def _make_experience(self) -> Experience | NoExperience:
        if not self.learners.need_experience:
            return NoExperience(self.collect)
        make_env = self.make_training_env or self.make_env
        return Experience(make_env, self.policy.collect, self.collect)

    def _make_evaluator(self) -> Evaluator:
        players = Players(self.policy, tuple(self.learners.algorithms))
        return make_evaluator(
            self.make_env,
            players,
            self.collect.groups,
            self.collect.processes_on(usable_cores()),
            self.evaluation.worlds,
            self.collect.limit,
        )

    def _notes(self) -> list[str]:
        notes = []
        if not self._has_best:
            notes.append(
                "no best.pt: several teams learn, and the mean of their returns does not measure "
                "their skill (it is 0 in a zero-sum game); the latest checkpoints are kept"
            )
            notes.append(
                "no comparison with random actions: in the baseline all these teams act at random; "
                "veca_marl.evaluate lets each of them act at random against the others' policies"
            )
        frames = self.schedule.frames
        if self._resumed_frames >= frames:
            notes.append(
                f"nothing was learnt: the run had {self._resumed_frames} frames already, "
                f"total_frames={frames}"
            )
        if self._resumed_within_stage:
            notes.append(
                "resumed: the stored run ended between two evaluations, so that this run evaluates "
                "and starts its worlds anew at other frames than one without interruption"
            )
        if self._resumed_frames and not self.learners.exact_resume:
            notes.append("resumed: an algorithm of this run does not continue bit for bit")
        return notes

    @property
    def _has_best(self) -> bool:
        """Whether the mean return measures progress: one team learns, its opponents stay."""
        return len(self.learners.algorithms) == 1

    def _train(self, experience: Experience | NoExperience) -> dict[str, Scores] | None:
        """Go through all stages and return the scores of the last, if there was one."""
        scores = None
        shown = self.schedule.frames, self.progress.frames
        with closing(ProgressDisplay(*shown, self.progress_bar)) as display:
            finished = self._is_finished()
            while not finished:
                self._run_stage(experience, display)
                finished = self._is_finished()
                scores = self._end_stage(finished)
                display.end_stage()
        return scores

    def _is_finished(self) -> bool:
        """Whether the frames, or the time, of the budget are spent."""
        spent = self.budget.is_spent(self._clock.elapsed())
        return spent or self.progress.iteration >= self.schedule.batches

    @property
    def schedule(self) -> Schedule:
        """Batches and stages of the whole run."""
        frames = self.budget.total_frames
        episode = math.ceil((self.episode_steps or 0) / self.collect.steps)
        return Schedule.of(frames, self.evaluation.every_frames, self.collect.frames, episode)

    def frames_to_learn(self, team: str) -> int:
        """Return the frames from which a team learns in the rest of the budget."""
        stages = enumerate(self.schedule.stages_after(self.progress.iteration), self.progress.stage)
        batches = sum(batches for stage, batches in stages if self.matchmaking.learns(team, stage))
        return batches * self.collect.frames

    def timing(self) -> str:
        """Return a table of where the time went."""
        return timing_table(self._clock.elapsed(), self.progress.frames - self._resumed_frames)

    def _run_stage(self, experience: Experience | NoExperience, display: ProgressDisplay) -> None:
        self.matchmaking.begin_stage(self.progress.stage, self.progress.frames)
        self._update_policy(experience)
        with timeit("collect"):
            experience.restart(derived_seed(self.seed, self.progress.stage))
        batches = next(self.schedule.stages_after(self.progress.iteration))
        steps = batches * self.collect.steps
        longest = self.episode_steps
        self._episodes.begin_stage(math.inf if longest is None else steps - longest)
        for number in range(batches):
            batch, row = self._iterate(experience)
            finished = {k: v for k, v in row.items() if k.endswith("/return") and v == v}
            display.update(self.collect.frames, finished)
            if number + 1 == batches and experience.plays:
                self._report_values(_actions(batch, self.learners.specs))

    def _is_first_episode(self) -> bool:
        """Return whether the worlds may still play the first episode of the run."""
        done = self.progress.iteration * self.collect.steps
        return done == 0 or (self.episode_steps is not None and done < self.episode_steps)

    def _iterate(
        self, experience: Experience | NoExperience
    ) -> tuple[TensorDictBase, dict[str, float]]:
        """Learn from one batch, and return it and the numbers that were written."""
        self._stopwatch.begin()
        with timeit("collect"):
            batch = experience.collect()
            if experience.plays:
                check_batch(batch, list(self.learners.algorithms), self.progress.frames)
            if experience.plays and self._is_first_episode():
                specs = {team: self.learners.specs[team] for team in self.learners.algorithms}
                warn_of_ranges(batch, specs, self.progress.frames)
        with timeit("learn"):
            measured = self.learners.learn(batch)
        with timeit("transfer"):
            self._update_policy(experience)
        self.progress.iteration += 1
        self.progress.frames += self.collect.frames
        row: dict[str, float] = {"iteration": self.progress.iteration}
        for team, measures in measured.items():
            both = (self._episodes.add(batch, team) if experience.plays else {}) | measures
            row |= {f"{team}/{name}": value for name, value in both.items()}
        row |= self.matchmaking.measures()
        row |= self._stopwatch.end(self.collect.frames)
        row |= device_memory(self.learners.device)
        for reporter in self.reporters:
            reporter.write("metrics", self.progress.frames, row)
        return batch, row

    def _update_policy(self, experience: Experience | NoExperience) -> None:
        """Let the worlds be played by the current policy, its opponents loaded."""
        self.policy.take_over(self.learners.policy)
        self.matchmaking.load_opponent(self.policy)
        experience.update_policy()

    def _end_stage(self, last: bool) -> dict[str, Scores] | None:
        """Evaluate, unless the stage is the short first one, and store a checkpoint."""
        self.policy.take_over(self.learners.policy)
        scores, best = None, False
        if last:
            scores = self._evaluations.play_last(self.during_last_evaluation)
        elif self.schedule.is_evaluated(self.progress.iteration):
            scores = self._evaluations.play()
        if scores is not None:
            self._report_scores("policy", scores)
            best = self._is_best(scores)
        self.progress.stage += 1
        self.matchmaking.end_stage(self.progress.frames)
        with timeit("checkpoint"):
            self._save(best)
        return scores

    def _is_best(self, scores: dict[str, Scores]) -> bool:
        if not self._has_best:
            return False
        (team,) = self.learners.algorithms
        mean = float(scores[team].returns[: self.evaluation.episodes].mean())
        best = mean > self.progress.best_return
        self.progress.best_return = max(mean, self.progress.best_return)
        return best

    def _save(self, best: bool) -> None:
        state = {
            "algorithm": self.learners.state_dict(),
            "intrinsic": self.learners.intrinsic_state(),
            "actors": self.learners.actor_states(),
            "progress": asdict(self.progress),
            "episodes": self._episodes.last,
        }
        check_state(state["algorithm"], self.progress.frames)
        check_state({"intrinsic": state["intrinsic"]}, self.progress.frames)
        for reporter in self.reporters:
            reporter.sync()
        numbers = {team: to_plain(cfg) for team, cfg in self.learners.cfgs.items()}
        self.checkpoints.save(state, self.progress.frames, best, numbers)

    @property
    def evaluation_seed(self) -> int:
        """Seed of the episodes of all evaluations."""
        return evaluation_seed(self.seed)

    def _report_scores(self, player: str, scores: dict[str, Scores]) -> None:
        for row in score_rows(player, scores):
            for reporter in self.reporters:
                reporter.write("evaluations", self.progress.frames, row)
        self._report_values(
            {f"evaluations/{player}/{team}/return": one.returns for team, one in scores.items()}
        )

    def _report_values(self, values: Mapping[str, NDArray[Any]]) -> None:
        for reporter in self.reporters:
            reporter.write_values(self.progress.frames, values)
