"""The scores of BabyBench 2025: ``python -m veca_marl.babybench +task=SelfTouch policy=expert``.

Plays ten episodes of SelfTouch or HandRegard, by default of 1000 steps, and prints the score of
each, their mean and what it consists of. ``policy`` is expert, random, the folder of a run or a
checkpoint in it. A run is played on its stored configuration. See the pages of both tasks for the
definitions.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass, field

import numpy as np
import torch

from veca_marl.algos.checkpoints import CheckpointError
from veca_marl.algos.files import WriteError, write_atomically
from veca_marl.config import ConfigError, one_line
from veca_marl.config.command_line import CommandLine, check_file
from veca_marl.envs.core.task import find_task
from veca_marl.envs.tasks.self_touch import HANDS, SelfTouch, regions_of
from veca_marl.play.session import EXPERT, Session, choose

SUITE = "babybench"
STEPS = 1000  # of an episode in BabyBench
_ERRORS = (CheckpointError, WriteError)


@dataclass
class BabyBenchOptions:
    """Options of the command.

    Attributes:
        policy: What plays: expert, random, the folder of a run, or a checkpoint in it.
        episodes: Number of episodes; 10 in BabyBench.
        seed: Seed of the episodes.
        json: File that the result is written to; None writes none.
    """

    policy: str = EXPERT
    episodes: int = 10
    seed: int = 1
    json: str | None = None

    def __post_init__(self) -> None:
        if self.episodes < 1:
            raise ValueError(f"episodes must be at least 1, got {self.episodes}")
        if self.seed < 0:
            raise ValueError(f"seed must be 0 or more, got {self.seed}")


@dataclass
class Result:
    """The scores of some episodes.

    Attributes:
        task: The task.
        policy: The policy.
        steps: Steps of an episode.
        parts: The parts of the score, by the name of the reward term: one number per episode.
        touched: Of SelfTouch, by hand and region: in how many episodes the hand touched it.
    """

    task: str
    policy: str
    steps: int
    parts: dict[str, list[float]] = field(default_factory=dict)
    touched: dict[str, dict[str, int]] = field(default_factory=dict)

    @property
    def scores(self) -> list[float]:
        """The score of each episode: the mean of its parts."""
        return [float(np.mean(numbers)) for numbers in zip(*self.parts.values(), strict=True)]

    @property
    def union_score(self) -> float:
        """Share of the regions that were touched in at least one episode (BabyBench's own sum)."""
        counts = [count for regions in self.touched.values() for count in regions.values()]
        return float(np.mean(np.array(counts) > 0))

    def add(self, sums: Mapping[str, float]) -> None:
        """Add the sums of the reward terms of an episode."""
        for name, value in sums.items():
            self.parts.setdefault(name, []).append(value)

    def add_touched(self, touched: Mapping[str, set[str]]) -> None:
        """Add the regions that were touched in an episode, by hand."""
        for hand, side in HANDS.items():
            counts = self.touched.setdefault(hand, dict.fromkeys(regions_of(side), 0))
            for region in touched[hand]:
                counts[region] += 1


def play(session: Session, result: Result, episodes: int) -> None:
    """Play episodes and add what they give to a result."""
    for episode in range(episodes):
        moment = session.begin(episode)
        sums = dict.fromkeys(moment.unweighted, 0.0)
        while not moment.done:
            moment = session.step()
            sums = {name: sums[name] + value for name, value in moment.unweighted.items()}
        result.add(sums)
        if isinstance(session.game.task, SelfTouch):
            result.add_touched(session.game.task.touched)


def lines(result: Result) -> list[str]:
    """Return the result as lines of text."""
    episodes = f"{len(result.scores)} episodes of {result.steps} steps"
    text = [f"{result.task}, policy {result.policy}, {episodes}"]
    if result.steps != STEPS:
        text.append(f"not comparable with BabyBench, whose episodes have {STEPS} steps")
    text += [f"score {np.mean(result.scores):.3f} (mean over the episodes)"]
    text += ["episodes " + " ".join(f"{score:.3f}" for score in result.scores)]
    text += [f"{name:24} {np.mean(values):.3f}" for name, values in result.parts.items()]
    if result.touched:
        text.append(f"score {result.union_score:.3f} of the regions touched in any episode")
        text.append("episodes in which a hand touched a region:")
    for hand, regions in result.touched.items():
        text.append(f"{hand}: " + ", ".join(f"{name} {count}" for name, count in regions.items()))
    return text


def run(options: BabyBenchOptions, overrides: list[str]) -> None:
    """Play the episodes, print the scores and write the JSON file."""
    torch.set_num_threads(1)
    json_file = None if options.json is None else check_file(options.json, "json")
    choice = choose(options.policy, overrides)
    name = choice.cfg.task.name
    if find_task(name).suite != SUITE:
        raise ConfigError(f"+task={name} is not in the suite {SUITE}: SelfTouch, HandRegard")
    try:
        session = Session(choice.cfg.game, choice.make_policy, options.seed, choice.exploration)
    except ValueError as error:
        raise ConfigError(one_line(error)) from error
    result = Result(name, options.policy, session.game.max_steps)
    play(session, result, options.episodes)
    session.close()
    print(*lines(result), sep="\n")
    if json_file is not None:
        content = {**asdict(result), "scores": result.scores}
        write_atomically(json_file, json.dumps(content, indent=2) + "\n")


def main(words: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit status."""
    return CommandLine("babybench", BabyBenchOptions, str(__doc__), _ERRORS, outputs=("json",)).run(
        run, words
    )


if __name__ == "__main__":
    raise SystemExit(main())
