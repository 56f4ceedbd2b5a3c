"""Print which modules and functions of veca_marl one agent step enters.

``python -m tools.trace_step`` plays KickTheBall in one world with random actions and traces one
step of the TorchRL environment after ``--warm`` others; ``--policy`` traces the policy of a short
training run beside the environment. Compiled kernels are no functions of Python and not counted.
"""

from __future__ import annotations

import argparse
import sys
from collections import Counter
from collections.abc import Callable, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from types import CodeType, FrameType
from typing import Any

import torch

import veca_marl
from tools.checkout import check_imported

PACKAGE = "veca_marl"
Policy = Callable[[Any], Any]
"""Writes the actions of all teams into a TensorDict and returns it."""

SHORT_RUN = (
    "collect=one_process",
    "collect.worlds=1",
    "collect.steps=32",
    "eval.every_frames=32",
    "eval.episodes=1",
    "eval.worlds=1",
    "task.max_seconds=1",
    "log=silent",
    "threads=1",
    "device=cpu",
)


@dataclass
class Trace:
    """Calls of the functions of one package.

    Attributes:
        package: Its name.
        calls: Number of calls by module and code of the function; comprehensions and lambdas are
            functions too.
    """

    package: str
    calls: Counter[tuple[str, CodeType]] = field(default_factory=Counter)

    def __call__(self, frame: FrameType, event: str, _: object) -> None:
        """Count a call; the signature is that of `sys.setprofile`."""
        module = frame.f_globals.get("__name__", "")
        if event == "call" and module.partition(".")[0] == self.package:
            self.calls[module, frame.f_code] += 1

    def modules(self) -> dict[str, tuple[int, int]]:
        """Return the numbers of functions and of calls by module, in the order of the names."""
        names = sorted({module for module, _ in self.calls})
        return {name: self._of(name) for name in names}

    def _of(self, name: str) -> tuple[int, int]:
        calls = [number for (module, _), number in self.calls.items() if module == name]
        return len(calls), sum(calls)


def trace(package: str, action: Callable[[], object]) -> Trace:
    """Call a function and return which functions of a package it has entered."""
    found = Trace(package)
    sys.setprofile(found)
    try:
        action()
    finally:
        sys.setprofile(None)
    return found


def trace_step(env: Any, policy: Policy, warm: int) -> Trace:
    """Trace one step of an environment.

    Args:
        env: The environment.
        policy: Chooses the actions; its functions count too.
        warm: Steps that are played before, whose functions do not count.
    """
    state = env.reset()
    for _ in range(warm):
        _, state = env.step_and_maybe_reset(policy(state))
    return trace(PACKAGE, lambda: env.step(policy(state)))


def trained_policy(task: str) -> Policy:
    """Return the policy of a training run of a few frames with the default algorithm."""
    learnt = veca_marl.train(task, total_frames=32, overrides=SHORT_RUN).policy

    def act(state: Any) -> Any:
        with torch.no_grad():
            return learnt(state)

    return act


def report(title: str, found: Trace) -> list[str]:
    """Return the lines that are printed: the totals, then a line for each module."""
    modules = found.modules()
    total = sum(found.calls.values())
    rows = [
        f"{functions:5} {calls:6}  {name}"
        for name, (functions, calls) in sorted(modules.items(), key=lambda one: -one[1][1])
    ]
    return [
        f"{title}: {len(modules)} modules, {len(found.calls)} functions, {total} calls",
        "functions calls  module",
        *rows,
    ]


def main(words: Sequence[str] | None = None) -> None:
    """Print the trace."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("task", nargs="?", default="KickTheBall", help="KickTheBall by default")
    parser.add_argument("--warm", type=int, default=5, metavar="N", help="steps before, default 5")
    parser.add_argument("--policy", action="store_true", help="a learnt policy acts")
    asked = parser.parse_args(words)
    check_imported(veca_marl.__file__)
    torch.manual_seed(0)
    with closing(veca_marl.make(asked.task, seed=0)) as env:
        policy = trained_policy(asked.task) if asked.policy else env.rand_action
        found = trace_step(env, policy, asked.warm)
    print(*report(f"{asked.task}, one step after {asked.warm}", found), sep="\n")


if __name__ == "__main__":
    main()
