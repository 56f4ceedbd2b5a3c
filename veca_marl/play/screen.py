"""The whole picture: the views, the senses and the reward of an agent, and a few lines."""

from __future__ import annotations

from collections.abc import Sequence

from veca_marl.envs.rendering.film import Film, FilmCfg
from veca_marl.envs.rendering.panels import Image, TermBar
from veca_marl.play.session import Moment, Session


class Screen:
    """Draws moments of a session; it remembers the spectra of the last second.

    Args:
        session: The session.
        cfg: Size of the picture, camera and panels.

    Raises:
        ValueError: If there is no such agent.
    """

    def __init__(self, session: Session, cfg: FilmCfg) -> None:
        self._session, self._cfg = session, cfg
        self._film = Film(session.game, cfg)
        self._largest = dict.fromkeys(session.game.weights, 0.0)

    def add(self, moment: Moment) -> None:
        """Take note of a moment; call it once for each, also for those that are not drawn."""
        if self._is_first:
            self._film.listen(moment.observation)
        for name, value in moment.terms.items():
            self._largest[name] = max(self._largest[name], abs(value))

    def draw(self, moment: Moment, lines: Sequence[str]) -> Image:
        """Return the picture of the moment that was added last, ``(height, width, 3)`` uint8.

        Args:
            moment: The moment.
            lines: Text in the lower right corner, below the state of the episode.
        """
        if not self._is_first:  # the moment is that of the first agent
            return self._film.picture(None, (), [self._film.player.name, *lines])
        text = [*self._state(moment), *lines]
        return self._film.picture(moment.observation, self._bars(moment), text)

    @property
    def _is_first(self) -> bool:
        """Whether the agent of the panels is the one of the moments."""
        return self._film.player.name == self._session.game.actors[0].name

    def _bars(self, moment: Moment) -> list[TermBar]:
        return [
            TermBar(name, value, moment.sums[name], self._largest[name])
            for name, value in moment.terms.items()
        ]

    def _state(self, moment: Moment) -> list[str]:
        time_s = moment.steps * self._session.step_s
        game = self._session.game
        state = [
            f"{game.cfg.task.name}: {game.actors[0].name}",
            f"time {time_s:.2f} s, step {moment.steps} of {game.max_steps}",
            f"reward {sum(moment.terms.values()):.4f}, return {sum(moment.sums.values()):.3f}",
        ]
        ending = ["the episode has ended"] if moment.done else []
        if moment.solved is not None:
            ending.insert(0, "solved" if moment.solved else "not solved")
        return [*state, ", ".join(ending)]
