"""Measure what it costs that worlds are on a server: ``python -m tools.remote_rates``.

A server of this machine, at the loopback, and this process play the same game in turns. Wall time:
a server works while its client waits. Reported are medians over the rounds, of times and of ratios
within a round.
"""

from __future__ import annotations

import subprocess
import sys
import tempfile
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import Any

import torch

from veca_marl.api import connect, gym_env, make
from veca_marl.config.command_line import CommandLine


@dataclass
class RemoteRatesOptions:
    """Options of the command.

    Attributes:
        task: The task.
        worlds: Worlds of the batch.
        steps: Steps of each measurement.
        rounds: Measurements of each kind, in turns.
        encrypted: Whether the connection has keys.
    """

    task: str = "KickTheBall"
    worlds: int = 16
    steps: int = 100
    rounds: int = 7
    encrypted: bool = True


@contextmanager
def served(task: str, worlds: int, encrypted: bool) -> Iterator[tuple[str, Path | None]]:
    """Serve a task at a free port of the loopback; yield the address and the file of keys."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "veca_marl.serve"]
        words = [f"+task={task}", f"worlds={worlds}", "address=tcp://127.0.0.1:*"]
        key = Path(folder, "keys", "client.key.json") if encrypted else None
        if key is not None:
            words.append(f"keys={key.parent}")
            subprocess.run([*command, f"keys={key.parent}", "new_client=client"], check=True)
        server = subprocess.Popen([*command, *words], stdout=subprocess.PIPE, text=True)
        try:
            assert server.stdout is not None
            line = server.stdout.readline()
            print(line, end="")
            yield line.split()[2].rstrip(":"), key
        finally:
            server.terminate()
            server.wait()


def one_agent_ms(env: Any, steps: int) -> float:
    """Return the milliseconds of a step of a Gymnasium environment, at rest."""
    env.reset(seed=0)
    action = env.action_space.sample()
    begin = time.perf_counter()
    for _ in range(steps):
        _, _, terminated, truncated, _ = env.step(action)
        if terminated or truncated:
            env.reset()
    return 1e3 * (time.perf_counter() - begin) / steps


def batch_ms(env: Any, steps: int) -> float:
    """Return the milliseconds of a step of all worlds, with random actions."""
    env.set_seed(0)
    torch.manual_seed(0)
    begin = time.perf_counter()
    env.rollout(steps, break_when_any_done=False)
    return 1e3 * (time.perf_counter() - begin) / steps


def in_turns(measure: Any, local: Any, remote: Any, steps: int, rounds: int) -> str:
    """Return a line with both times, what is added, and the ratio of the rates."""
    for env in (local, remote):
        measure(env, 5)
    pairs = [(measure(local, steps), measure(remote, steps)) for _ in range(rounds)]
    added = median(there - here for here, there in pairs)
    ratio = median(here / there for here, there in pairs)
    here, there = (median(column) for column in zip(*pairs, strict=True))
    return (
        f"here {here:.2f} ms, on the server {there:.2f} ms a step: "
        f"{added:+.2f} ms, rate {ratio:.3f} of that here"
    )


def run(options: RemoteRatesOptions, overrides: list[str]) -> None:
    """Measure and print."""
    torch.set_num_threads(1)
    with served(options.task, options.worlds, options.encrypted) as (address, key):
        here: Any = gym_env(options.task, overrides=overrides)
        there: Any = connect(address, key=key, library="gymnasium")
        print("1 world:", in_turns(one_agent_ms, here, there, options.steps, options.rounds))
        here.close()
        there.close()
        here, there = make(options.task, worlds=options.worlds), connect(address, key=key)
        line = in_turns(batch_ms, here, there, max(options.steps // 5, 5), options.rounds)
        print(f"{options.worlds} worlds: {line}")
        here.close()
        there.close()


def main(words: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit status."""
    return CommandLine("remote_rates", RemoteRatesOptions, str(__doc__)).run(run, words)


if __name__ == "__main__":
    sys.exit(main())
