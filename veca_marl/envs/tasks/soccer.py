"""SoccerOnePlayer and SoccerTwoPlayer: put the ball into the goal of a pitch."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from veca_marl.envs.core.task import (
    Player,
    Task,
    TaskCfg,
    Team,
    horizontal_angle_rad,
    register_task,
    terms,
)
from veca_marl.envs.tasks.floors.places import direct_gaze_ahead, place_player
from veca_marl.envs.tasks.floors.playability import check_kickable
from veca_marl.sim.body.walker import Walker
from veca_marl.sim.geometry import Floats, horizontal_distance
from veca_marl.sim.physics import PlaygroundCfg, Prop, PropCfg, PropShape, World

POST_M = 0.04  # radius of posts and bar
CHILD_M = 0.45  # from the pelvis of a body on hands and knees to the front of its head, at most


@dataclass
class SoccerCfg(TaskCfg):
    """Parameters of SoccerOnePlayer. The pitch lies along x; the attacker shoots towards +x.

    Attributes:
        radius_m: Radius of the ball.
        mass_kg: Mass of the ball, at most `WalkerCfg.push_limit_kg` of players that walk.
        goal_width_m: Distance between the axes of the posts.
        goal_height_m: Height of the bar.
        goal_from_wall_m: Distance of the goal line from the end of the room, above `radius_m`.
        ball_from_goal_m: Least and greatest distance of the ball from the goal line at the start.
        aside_m: Largest lateral distance of ball and players from the middle line at the start.
        attacker_from_ball_m: Least and greatest distance of the attacker behind the ball at the
            start; at least 0.45 m from its surface.
        spread_deg: Largest angle at the start between the heading of a player and the direction
            of the ball, in [0, 180].
        kick_rest_s: Least time between two kicks of a player.
    """

    radius_m: float = 0.12
    mass_kg: float = 0.3
    goal_width_m: float = 1.4
    goal_height_m: float = 0.8
    goal_from_wall_m: float = 0.5
    ball_from_goal_m: tuple[float, float] = (2.0, 2.8)
    aside_m: float = 0.8
    attacker_from_ball_m: tuple[float, float] = (0.8, 1.6)
    spread_deg: float = 30.0
    kick_rest_s: float = 0.5
    weights: dict[str, float] = terms(goal=5.0, progress=0.5, approach=0.1, facing=0.0)

    def __post_init__(self) -> None:
        super().__post_init__()
        self.check_positive("radius_m", "mass_kg", "goal_from_wall_m", "kick_rest_s")
        for name in ("goal_width_m", "goal_height_m"):
            if not 2.0 * (self.radius_m + POST_M) < getattr(self, name) < math.inf:
                raise ValueError(
                    f"task.{name}={getattr(self, name)}: a ball of task.radius_m={self.radius_m} "
                    "does not fit through"
                )
        self._check_span("ball_from_goal_m", 0.3, "0.3 m or more")
        apart_m = self.radius_m + CHILD_M
        self._check_span(
            "attacker_from_ball_m",
            apart_m,
            f"at least {apart_m:g}: task.radius_m={self.radius_m:g} and {CHILD_M} m from pelvis to "
            "head",
        )
        if self.goal_from_wall_m <= self.radius_m:
            raise ValueError(
                f"task.goal_from_wall_m={self.goal_from_wall_m} must be larger than task.radius_m="
                f"{self.radius_m}: else the wall stops the ball before its centre passes the line"
            )
        if not 0.0 <= self.aside_m < math.inf:
            raise ValueError(f"task.aside_m={self.aside_m} must be 0 or more")
        if not 0.0 <= self.spread_deg <= 180.0:
            raise ValueError(f"task.spread_deg={self.spread_deg} must be in [0, 180]")


_BOARD_M = (0.06, 0.3)  # thickness and height
_CLEAR_AT_THE_END_M, _CLEAR_AT_THE_SIDES_M = 0.3, 0.6
_CORNER_M = 0.5  # length along both walls that the board across a corner cuts off
_WHITE, _YELLOW, _ORANGE = (0.95, 0.95, 0.95), (0.95, 0.75, 0.1), (1.0, 0.4, 0.05)


def check_start_area(cfg: SoccerCfg, playground: PlaygroundCfg) -> None:
    """Check that the start is clear of the boards, and that nothing is in front of the goal.

    Raises:
        ValueError: If it does not fit into the first room, or a prop has its middle there.
    """
    room = playground.rooms[0]
    length_m = cfg.ball_from_goal_m[1] + cfg.attacker_from_ball_m[1]
    width_m = 2.0 * cfg.aside_m
    free_m = room.size_m[0] - cfg.goal_from_wall_m - _CLEAR_AT_THE_END_M
    if length_m > free_m or width_m > room.size_m[1] - _CLEAR_AT_THE_SIDES_M:
        raise ValueError(
            f"playground {playground.name!r}: {length_m:g} m of task.ball_from_goal_m and "
            f"task.attacker_from_ball_m, {width_m:g} m of task.aside_m do not fit into room "
            f"{room.name!r} of {room.size_m[0]:g} x {room.size_m[1]:g} m; choose smaller ones, or "
            "playground=simple"
        )
    x, y, _ = room.middle_m
    goal_x = x + room.size_m[0] / 2.0 - cfg.goal_from_wall_m
    for prop in playground.built_props():
        along_m, aside_m = goal_x - prop.position_m[0], abs(prop.position_m[1] - y)
        if prop.tangible and 0.0 <= along_m <= length_m and aside_m <= cfg.aside_m:
            raise ValueError(
                f"playground {playground.name!r}: {prop.name!r} stands between the goal and the "
                "start of the attacker; choose playground=simple"
            )


def check_goal(cfg: SoccerCfg, playground: PlaygroundCfg) -> None:
    """Check that the goal fits between the boards across the corners of the first room.

    Raises:
        ValueError: If it does not.
    """
    room = playground.rooms[0]
    free_m = room.size_m[1] - 2.0 * _CORNER_M
    if cfg.goal_width_m > free_m:
        raise ValueError(
            f"playground {playground.name!r}: task.goal_width_m={cfg.goal_width_m:g} must be at "
            f"most {free_m:g} in room {room.name!r}, which is {room.size_m[1]:g} m wide with "
            f"boards of {_CORNER_M:g} m across its corners; choose a smaller goal, or "
            "playground=simple"
        )


class Pitch:
    """A pitch in the first room of a world, along x, with the goal at the end of greater x.

    Args:
        world: The world; ball, goal and boards are added to it.
        cfg: Parameters.

    Attributes:
        goal: Middle of the goal line on the floor, ``(3,)`` metres.
        goal_width_m: Distance between the axes of the posts.
        ball: The ball.
        low: Lower corner of the floor in front of the goal line, ``(2,)`` metres.
        high: Upper corner, ``(2,)`` metres.
    """

    def __init__(self, world: World, cfg: SoccerCfg) -> None:
        room = world.playground.rooms[0]
        low, size = np.array(room.lower_m), np.array(room.size_m)
        self._cfg, self.goal_width_m = cfg, cfg.goal_width_m
        self.goal: Floats = low + np.array([size[0] - cfg.goal_from_wall_m, size[1] / 2.0, 0.0])
        self.low: Floats = low[:2]
        self.high: Floats = np.array([self.goal[0], low[1] + size[1]])
        self.ball = self._add_ball(world)
        self._add_goal(world)
        self._add_boards(world)

    def scores(self, before: Floats, after: Floats) -> bool:
        """Return whether the centre of the ball has passed the goal line inside the goal.

        Args:
            before: Position of the ball, ``(3,)`` metres.
            after: Its position one step later, ``(3,)`` metres; the path is taken as straight.
        """
        if not before[0] < self.goal[0] <= after[0]:
            return False
        share = (self.goal[0] - before[0]) / (after[0] - before[0])
        _, aside, height = before + share * (after - before) - self.goal
        return bool(abs(aside) < self._cfg.goal_width_m / 2.0 and height < self._cfg.goal_height_m)

    def _add_ball(self, world: World) -> Prop:
        middle = (self.low + self.high) / 2.0
        return world.add_prop(
            PropCfg(
                name="ball",
                shape=PropShape.sphere,
                size_m=[self._cfg.radius_m],
                position_m=(float(middle[0]), float(middle[1]), self._cfg.radius_m),
                mass_kg=self._cfg.mass_kg,
                restitution=0.7,
                rolling_friction=0.004,
                colour=_ORANGE,
                checker_m=self._cfg.radius_m,
            )
        )

    def _add_goal(self, world: World) -> None:
        x, y, z = self.goal.tolist()
        world.add_prop(
            PropCfg(
                name="goal",
                shape=PropShape.goal,
                size_m=[self._cfg.goal_width_m, self._cfg.goal_height_m, POST_M],
                position_m=(x, y, z),
                colour=_YELLOW,
            )
        )

    def _add_boards(self, world: World) -> None:
        """Close the goal line beside the posts and cut the corners, which would trap the ball."""
        half_m = self._cfg.goal_width_m / 2.0
        centre = float(self.goal[1])
        for side, edge in (("right", self.low[1]), ("left", self.high[1])):
            inwards = math.copysign(1.0, centre - edge)
            post = np.array([self.goal[0], centre - inwards * half_m])
            corner = np.array([self.goal[0], edge])
            back = np.array([self.low[0], edge])
            along, across = np.array([_CORNER_M, 0.0]), np.array([0.0, _CORNER_M * inwards])
            _add_board(world, f"end_{side}", post, corner)
            _add_board(world, f"corner_{side}", corner - along, corner + across)
            _add_board(world, f"back_{side}", back + along, back + across)


def _add_board(world: World, name: str, start: Floats, end: Floats) -> None:
    """Add a low board between two points ``(2,)`` of the floor, from which a ball rebounds."""
    way, middle = end - start, (start + end) / 2.0
    thickness, height = _BOARD_M
    world.add_prop(
        PropCfg(
            name=name,
            shape=PropShape.box,
            size_m=[float(np.hypot(*way)), thickness, height],
            position_m=(float(middle[0]), float(middle[1]), height / 2.0),
            yaw_deg=math.degrees(math.atan2(way[1], way[0])),
            restitution=1.0,
            colour=_WHITE,
        )
    )


_ROUNDING = 1e-6  # in agent steps
_LEAST_SPEED_MPS = 0.1  # a standing walker does not kick: it stops the ball


class AutomaticKicks:
    """Lets walkers kick a ball that is within reach of a foot while they walk forwards.

    In one step only the nearest player kicks. Joint-level bodies do not kick automatically.

    Args:
        players: All players.
        ball: The ball.
        rest_s: Least time between two kicks of a player.
    """

    def __init__(self, players: Sequence[Player], ball: Prop, rest_s: float) -> None:
        self._players, self._ball, self._rest_s = players, ball, rest_s
        self.reset()

    @property
    def steps_left(self) -> dict[str, int]:
        """Steps until each player can kick again; 0 if it can."""
        return {name: max(steps, 0) for name, steps in self._steps_left.items()}

    def reset(self) -> None:
        """Allow all players to kick."""
        self._steps_left = {player.name: 0 for player in self._players}

    def after_step(self, step_s: float) -> None:
        """Count a step of a duration and let one player kick if it can."""
        ball = self._ball.position
        nearest_first = sorted(
            self._players, key=lambda p: horizontal_distance(p.body.position, ball)
        )
        self._steps_left = {name: steps - 1 for name, steps in self._steps_left.items()}
        for player in nearest_first:
            if self._steps_left[player.name] <= 0 and self._kicks(player):
                self._steps_left[player.name] = math.ceil(self._rest_s / step_s - _ROUNDING)
                return

    def _kicks(self, player: Player) -> bool:
        """Let a player kick if it can; return whether it has."""
        body = player.body
        walks = float(body.velocity @ body.forward) > _LEAST_SPEED_MPS
        return walks and isinstance(body, Walker) and body.kick(self._ball)


ATTACKER, DEFENDER = "attacker", "defender"
_MOST_APPROACH_M = 10.0  # longer chases are not rewarded


@dataclass(frozen=True)
class _State:
    """Position of the ball relative to the goal and to the attacker.

    Attributes:
        ball: Position of the ball, ``(3,)`` metres.
        to_goal_m: Distance from the ball to the middle of the goal line.
        to_ball_m: Distance from the attacker to the ball.
        bearing_rad: Angle between the forward direction of the attacker and the direction of the
            ball.
    """

    ball: Floats
    to_goal_m: float
    to_ball_m: float
    bearing_rad: float


class Soccer(Task):
    """The attacker has to put the ball into the goal; nothing is forbidden."""

    senses = ("vision", "touch", "proprioception")
    cfg: SoccerCfg

    @classmethod
    def check_playground(cls, cfg: Any, playground: PlaygroundCfg) -> None:
        check_start_area(cfg, playground)
        check_goal(cfg, playground)

    def build(self) -> None:
        self.pitch = Pitch(self.world, self.cfg)
        self.ball, self.goal = self.pitch.ball, self.pitch.goal
        check_kickable(self.players, self.ball)
        self._kicks = AutomaticKicks(self.players, self.ball, self.cfg.kick_rest_s)
        self._terms: dict[str, float] = {}
        self._scored = False
        self._approached_m = 0.0
        self._state = self._observe_state()

    def reset(self, rng: np.random.Generator) -> None:
        cfg = self.cfg
        back, aside = rng.uniform(*cfg.ball_from_goal_m), rng.uniform(-cfg.aside_m, cfg.aside_m)
        position = self.goal + np.array([-back, aside, cfg.radius_m])
        self.ball.place(position, rng.uniform(-math.pi, math.pi))
        for player in self.players:
            self._place_facing_ball(player, rng)
        direct_gaze_ahead(self.players)
        self._kicks.reset()
        self._scored = False
        self._approached_m = 0.0
        self._state = self._observe_state()

    def start(self, player: Player, rng: np.random.Generator) -> Floats:
        """Return the start of a player, ``(3,)`` metres; the attacker is behind the ball."""
        back = rng.uniform(*self.cfg.attacker_from_ball_m)
        aside = rng.uniform(-self.cfg.aside_m, self.cfg.aside_m)
        return np.array([self.ball.position[0] - back, self.goal[1] + aside, self.goal[2]])

    def after_step(self, rng: np.random.Generator) -> None:
        direct_gaze_ahead(self.players)
        before, attacker = self._state, self.players[0].body.position
        self._state = self._observe_state()
        self._scored = self._scored or self.pitch.scores(before.ball, self._state.ball)
        self._terms = {
            "goal": float(self._scored),
            "progress": before.to_goal_m - self._state.to_goal_m,
            "approach": self._approach_m(
                before.to_ball_m - horizontal_distance(attacker, before.ball)
            ),
            "facing": before.bearing_rad - self._state.bearing_rad,
        }
        self._kicks.after_step(self.world.clock.step_s)

    def reward(self, player: Player) -> dict[str, float]:
        sign = 1.0 if player.team == ATTACKER else -1.0
        return {term: sign * value for term, value in self._terms.items()}

    def state(self) -> dict[str, float]:
        step_s = self.world.clock.step_s
        rests = {f"{n}_rest_s": step_s * steps for n, steps in self._kicks.steps_left.items()}
        return {**rests, "approached_m": self._approached_m}

    def terminated(self) -> bool:
        return self._scored

    def solved(self, player: Player) -> bool:
        """Return whether a goal is scored; for a defender, whether none is scored."""
        return self._scored == (player.team == ATTACKER)

    def _approach_m(self, nearer_m: float) -> float:
        """Return by how much the sum of all approaches of the episode, if limited, has grown."""
        before_m, self._approached_m = self._approached_m, self._approached_m + nearer_m
        return min(self._approached_m, _MOST_APPROACH_M) - min(before_m, _MOST_APPROACH_M)

    def _observe_state(self) -> _State:
        attacker, ball = self.players[0].body, self.ball.position
        way = ball - attacker.position
        return _State(
            ball,
            math.dist(ball[:2], self.goal[:2]),
            math.hypot(way[0], way[1]),
            horizontal_angle_rad(way, attacker.forward),
        )

    def _place_facing_ball(self, player: Player, rng: np.random.Generator) -> None:
        start = self.start(player, rng)
        way = self.ball.position - start
        deviation = math.radians(rng.uniform(-self.cfg.spread_deg, self.cfg.spread_deg))
        place_player(player, start, math.atan2(way[1], way[0]) + deviation)


@register_task
class SoccerOnePlayer(Soccer):
    """A player starts behind a ball and has to put it into the goal at the end of the room.

    Nothing is forbidden. A goal is scored when the centre of the ball passes the goal line from
    the front, between the posts and under the bar; it terminates the episode, and the task is
    solved (`solved`). The player starts on hands and knees and pushes the ball. The paper (table of
    tasks in the appendix) says "put the ball into the goal with joint-level actions [...] there is
    no rule"; the numbers and all terms except `goal` are not in the paper. Departure: the eyes are
    turned to the horizon ahead in each step, because on hands and knees the face points to the
    floor.

    With `body=walker`, a variation that is not in the paper, the player walks; a ball within reach
    of its foot (`Walker.can_kick`) is kicked automatically, away from the body, at most once per
    `kick_rest_s`. A walker needs a third of the time (`task.max_seconds=20`).

    Terms:
        goal: 1 on the step in which the goal is scored, else 0.
        progress: Decrease during the step of the distance of the ball from the middle of the goal
            line, m.
        approach: Decrease during the step of the distance of the player from the ball's position
            before the step, m. It ignores the motion of the ball, so that kicking costs nothing; in
            an episode it adds up to at most 10, so that chasing the ball is worth less than a goal.
        facing: Decrease during the step of the angle between the player's forward direction and
            the direction of the ball, rad; over an episode it adds up to at most pi. It helps
            learning to look for the ball; its default weight is 0.
    """

    teams = (Team(ATTACKER),)


@dataclass
class SoccerTwoPlayerCfg(SoccerCfg):
    """Parameters of SoccerTwoPlayer. The pitch lies along x; the attacker shoots towards +x.

    Attributes:
        defender_from_goal_m: Least and greatest distance of the defender in front of the goal line
            at the start.
    """

    defender_from_goal_m: tuple[float, float] = (0.3, 0.8)

    def __post_init__(self) -> None:
        super().__post_init__()
        near, far = self.defender_from_goal_m
        apart_m = self.radius_m + CHILD_M
        if not 0.2 <= near <= far <= self.ball_from_goal_m[0] - apart_m:
            raise ValueError(
                f"task.defender_from_goal_m={(near, far)} must be (least, greatest), 0.2 m or "
                f"more, and {apart_m:g} m (task.radius_m and {CHILD_M} m from pelvis to head) "
                f"nearer than task.ball_from_goal_m={self.ball_from_goal_m}"
            )


@register_task
class SoccerTwoPlayer(Soccer):
    """SoccerOnePlayer with a defender between the ball and the goal.

    Nothing is forbidden: the defender may block and tackle, and both may push whatever they reach.
    With `body=walker`, a variation that is not in the paper, they walk and kick; of two walkers
    that reach the ball in one step the nearer one kicks. A goal, by
    either player, terminates the episode. The task is solved (`solved`) for the attacker when a
    goal is scored, and for the defender as long as none is. The paper (table of tasks in the
    appendix) says "the attacker must put the ball into the goal, and the defender must block the
    ball from the goal with joint-level actions [...] there is no rule"; the numbers and all terms
    except `goal` are not in the paper. Every term of the defender is minus that of the attacker
    (zero-sum). Departure: the eyes of players on hands and knees are turned to the horizon ahead in
    each step, as in SoccerOnePlayer.

    Terms:
        goal: 1 for the attacker on the step in which a goal is scored, else 0.
        progress: Decrease during the step of the distance of the ball from the middle of the goal
            line, m.
        approach: Decrease during the step of the distance of the attacker from the ball's position
            before the step, m. It ignores the motion of the ball, so that kicking costs nothing; in
            an episode it adds up to at most 10, so that chasing the ball is worth less than a goal.
            The defender is thus rewarded for standing in the attacker's path.
        facing: Decrease during the step of the angle between the attacker's forward direction and
            the direction of the ball, rad; over an episode it adds up to at most pi. It helps
            learning to look for the ball; its default weight is 0.
    """

    teams = (Team(ATTACKER), Team(DEFENDER))
    cfg: SoccerTwoPlayerCfg

    def start(self, player: Player, rng: np.random.Generator) -> Floats:
        if player.team == ATTACKER:
            return super().start(player, rng)
        back = rng.uniform(*self.cfg.defender_from_goal_m)
        half_m = min(self.cfg.aside_m, self.cfg.goal_width_m / 2.0)
        return np.array([self.goal[0] - back, self.goal[1] + rng.uniform(-half_m, half_m), 0.0])
