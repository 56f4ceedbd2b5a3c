"""Measure what it costs that worlds are on a server: ``python -m tools.remote_rates``.

A server of this machine, at the loopback, and this process play the same game in turns of a few
steps. Wall time, since a server works while its client waits. Where other programs use the cores, a
process that waits for another one is woken late; the processor time of client, server and worlds
together does not contain that.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import torch

from veca_marl.api import connect, gym_env, make
from veca_marl.config.command_line import CommandLine


@dataclass
class RemoteRatesOptions:
    """Options of the command.

    Attributes:
        task: The task.
        worlds: Worlds of the batch.
        steps: Steps of each kind in a round.
        rounds: Number of rounds.
        encrypted: Whether the connection has keys.
        busy_wait_s: Of the server, see `veca_marl.serve`.
    """

    task: str = "KickTheBall"
    worlds: int = 16
    steps: int = 20
    rounds: int = 25
    encrypted: bool = True
    busy_wait_s: float = 0.0005


@contextmanager
def served(options: RemoteRatesOptions) -> Iterator[tuple[str, Path | None]]:
    """Serve a task at a free port of the loopback; yield the address and the file of keys."""
    with tempfile.TemporaryDirectory() as folder:
        command = [sys.executable, "-m", "veca_marl.serve"]
        words = [f"+task={options.task}", f"worlds={options.worlds}"]
        words += ["address=tcp://127.0.0.1:*", f"busy_wait_s={options.busy_wait_s}"]
        key = Path(folder, "keys", "client.key.json") if options.encrypted else None
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


Player = Callable[[], None]
"""Plays one step."""


def one_agent(env: Any) -> Player:
    """Return what plays a step of a Gymnasium environment, with one action throughout."""
    env.reset(seed=0)
    action = 0 * env.action_space.sample()

    def play() -> None:
        _, _, terminated, truncated, _ = env.step(action)
        if terminated or truncated:
            env.reset()

    return play


def batch(env: Any) -> Player:
    """Return what plays a step of all worlds, with random actions."""
    env.set_seed(0)
    torch.manual_seed(0)
    state = env.reset()

    def play() -> None:
        nonlocal state
        _, state = env.step_and_maybe_reset(env.rand_action(state))

    return play


def in_turns(here: Player, there: Player, steps: int, rounds: int) -> str:
    """Return lines with the times of a step, what is added, and the ratio of the rates.

    A round is some steps of either kind. Of wall times the median is reported, and the lower
    quartile, which other programs on the same cores disturb less; of processor times, in which a
    round has one, the median.
    """
    walls: tuple[list[float], list[float]] = ([], [])
    works: tuple[list[float], list[float]] = ([], [])
    for number in range(rounds + 1):
        for play, wall, work in zip((here, there), walls, works, strict=True):
            before = processor_s()
            seconds = [_seconds(play) for _ in range(steps)]
            if number:  # the first round warms up
                wall += seconds
                work.append((processor_s() - before) / steps)
    columns = {
        "wall time, lower quartile": [np.percentile(one, 25) for one in walls],
        "wall time, median": [np.percentile(one, 50) for one in walls],
        "processor time, median": [np.percentile(one, 50) for one in works],
    }
    lines = [
        f"  {name}: {1e3 * own:.2f} ms here, {1e3 * other:.2f} ms on the server, "
        f"{1e3 * (other - own):+.2f} ms; rate {own / other:.3f} of that here"
        for name, (own, other) in columns.items()
    ]
    return "\n".join(["", *lines])


def processor_s() -> float:
    """Return the processor time that this process and all it has started have used (Linux)."""
    nanoseconds = 0
    for process in [os.getpid(), *_descendants(os.getpid())]:
        for path in Path(f"/proc/{process}/task").glob("*/schedstat"):
            with suppress(OSError):  # it has ended
                nanoseconds += int(path.read_text().split()[0])
    return 1e-9 * nanoseconds


def _descendants(process: int) -> list[int]:
    with suppress(OSError):
        texts = [p.read_text() for p in Path(f"/proc/{process}/task").glob("*/children")]
        own = [int(child) for text in texts for child in text.split()]
        return own + [one for child in own for one in _descendants(child)]
    return []


def _seconds(play: Player) -> float:
    begin = time.perf_counter()
    play()
    return time.perf_counter() - begin


def run(options: RemoteRatesOptions, overrides: list[str]) -> None:
    """Measure and print."""
    torch.set_num_threads(1)
    with served(options) as (address, key):
        here: Any = gym_env(options.task, overrides=overrides)
        there: Any = connect(address, key=key, library="gymnasium")
        rounds, steps = options.rounds, options.steps
        print("1 world:", in_turns(one_agent(here), one_agent(there), steps, rounds), flush=True)
        here.close()
        there.close()
        here, there = make(options.task, worlds=options.worlds), connect(address, key=key)
        steps = max(steps // 4, 1)
        print(f"{options.worlds} worlds:", in_turns(batch(here), batch(there), steps, rounds))
        here.close()
        there.close()


def main(words: Sequence[str] | None = None) -> int:
    """Run the command line; return the exit status."""
    return CommandLine("remote_rates", RemoteRatesOptions, str(__doc__)).run(run, words)


if __name__ == "__main__":
    sys.exit(main())
