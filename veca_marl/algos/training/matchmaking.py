"""Which teams learn in a stage and against which opponents: the interface that the loop uses."""

from __future__ import annotations

from typing import Protocol

from veca_marl.algos.policy import Policy


class Matchmaking(Protocol):
    """Chooses for each stage the teams that learn and their opponents."""

    def begin_stage(self, stage: int, frames: int) -> None:
        """Choose; the choice depends on the arguments and the seed alone.

        Args:
            stage: Number of finished stages.
            frames: Frames learnt from so far.
        """
        ...

    def learns(self, team: str, stage: int) -> bool:
        """Return whether a team that is not frozen learns in a stage."""
        ...

    def load_opponent(self, policy: Policy) -> None:
        """Load the parameters of the opponent into the copy of the policy that collects."""
        ...

    def end_stage(self, frames: int) -> None:
        """Store what was learnt as a possible opponent of later stages."""
        ...

    def measures(self) -> dict[str, float]:
        """Return numbers for the logs that describe this stage's match."""
        ...


class AllLearn:
    """Every team learns in every stage, against the current policies of the others."""

    def begin_stage(self, stage: int, frames: int) -> None:
        """See `Matchmaking`."""

    def learns(self, team: str, stage: int) -> bool:
        """See `Matchmaking`."""
        return True

    def load_opponent(self, policy: Policy) -> None:
        """See `Matchmaking`."""

    def end_stage(self, frames: int) -> None:
        """See `Matchmaking`."""

    def measures(self) -> dict[str, float]:
        """See `Matchmaking`."""
        return {}
