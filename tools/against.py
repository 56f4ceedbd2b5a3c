"""Compare the processor time of agent steps in this checkout with that in another commit.

``python -m tools.against 7e5535a KickTheBall TurnBaby --worlds 16`` extracts the commit, starts a
process of each version with the same worlds, and lets them play in turns, so that both see the same
load of the machine. It prints the median of the ratios of neighbouring turns.
"""

from __future__ import annotations

import argparse
import os
import subprocess
import sys
import tarfile
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from pathlib import Path
from statistics import median
from typing import IO

from tools.checkout import ROOT

# plays with functions that both versions have; actions are drawn before the time is taken
_PLAYER = """
import sys, time
import torch, veca_marl
task, worlds, steps, warm_up, *overrides = sys.argv[1:]
worlds, steps = int(worlds), int(steps)
torch.set_num_threads(1)
env = veca_marl.make(task, worlds=worlds, seed=0, overrides=overrides)
torch.manual_seed(0)
actions = [env.full_action_spec.rand() for _ in range(steps)]
agents = worlds * sum(len(names) for names in env.group_map.values())
state = env.reset()
def play():
    global state
    for action in actions:
        _, state = env.step_and_maybe_reset(state.update(action))
for _ in range(int(warm_up)):
    play()
print("ready", flush=True)
for _ in sys.stdin:
    start = time.process_time()
    play()
    print(1e3 * (time.process_time() - start) / (steps * agents), flush=True)
"""
_WARM_UP = 1  # turns


@dataclass(frozen=True)
class Turns:
    """Milliseconds of processor time of an agent step in each turn.

    Attributes:
        other: Of the other commit.
        here: Of this checkout.
    """

    other: tuple[float, ...]
    here: tuple[float, ...]

    @property
    def ratios(self) -> list[float]:
        """How many times as fast this checkout is, turn by turn."""
        return [other / here for other, here in zip(self.other, self.here, strict=True)]


class Player:
    """A process of one version that plays a turn when it is asked.

    Args:
        root: Folder of the version.
        arguments: Task, worlds, steps of a turn, turns before the first, and overrides.
    """

    def __init__(self, root: Path, arguments: Sequence[str]) -> None:
        self._process = subprocess.Popen(
            [sys.executable, "-c", _PLAYER, *arguments],
            cwd=root,
            env=os.environ | {"PYTHONPATH": str(root)},
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            text=True,
        )
        self._answer()  # it has built its worlds

    def play(self) -> float:
        """Play a turn; return milliseconds of processor time per agent step."""
        asked = self._pipe(self._process.stdin)
        asked.write("\n")
        asked.flush()
        return float(self._answer())

    def _answer(self) -> str:
        line = self._pipe(self._process.stdout).readline()
        if not line:
            raise SystemExit(f"error: a player ended with status {self._process.wait()}")
        return line

    @staticmethod
    def _pipe(pipe: IO[str] | None) -> IO[str]:
        assert pipe is not None
        return pipe

    def close(self) -> None:
        """End the process."""
        self._process.kill()
        self._process.wait()


@contextmanager
def extracted(revision: str) -> Iterator[Path]:
    """Yield a folder with the files of a commit.

    Raises:
        SystemExit: If there is no such commit.
    """
    with tempfile.TemporaryDirectory() as folder:
        archive = Path(folder) / "commit.tar"
        command = ["git", "-C", str(ROOT), "archive", f"--output={archive}", revision]
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        if done.returncode:
            raise SystemExit(f"error: {revision}: {done.stderr.strip().splitlines()[-1]}")
        with tarfile.open(archive) as files:
            files.extractall(folder, filter="data")
        yield Path(folder)


def measure(other: Path, arguments: Sequence[str], rounds: int) -> Turns:
    """Let both versions play in turns.

    Args:
        other: Folder of the other version.
        arguments: See `Player`.
        rounds: Turns of each.
    """
    with ExitStack() as players:
        there, here = Player(other, arguments), Player(ROOT, arguments)
        players.callback(there.close)
        players.callback(here.close)
        pairs = [(there.play(), here.play()) for _ in range(rounds)]
    return Turns(*zip(*pairs, strict=True))


def main(words: Sequence[str] | None = None) -> int:
    """Run the command; return its exit status."""
    parser = argparse.ArgumentParser(description=__doc__, prog="python -m tools.against")
    parser.add_argument("revision")
    parser.add_argument("tasks", nargs="+")
    parser.add_argument("--worlds", type=int, nargs="+", default=[16])
    parser.add_argument("--steps", type=int, default=100, help="of a turn, in each world")
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--overrides", nargs="*", default=[])
    asked = parser.parse_args(words)
    print(f"{'task':<18}{'worlds':>7}{'before':>9}{'now':>9}   times as fast (all turns)")
    with extracted(asked.revision) as other:
        for task in asked.tasks:
            for worlds in asked.worlds:
                numbers = [str(worlds), str(asked.steps), str(_WARM_UP)]
                turns = measure(other, [task, *numbers, *asked.overrides], asked.rounds)
                ratios = " ".join(f"{ratio:.2f}" for ratio in turns.ratios)
                before, now = median(turns.other), median(turns.here)
                print(
                    f"{task:<18}{worlds:>7}{before:>7.3f}ms{now:>7.3f}ms   "
                    f"{median(turns.ratios):.2f} ({ratios})",
                    flush=True,
                )
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
