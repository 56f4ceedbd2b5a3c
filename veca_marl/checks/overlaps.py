"""Bodies and props of a game that penetrate each other."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import combinations

from veca_marl.envs.core.game import Game
from veca_marl.sim.body.walker import Walker
from veca_marl.sim.physics import World, pybullet

GREATEST_OVERLAP_M = 0.005
"""Depth up to which contacts are no overlap; skin yields by less, and so do resting props."""

_BODY_A, _BODY_B, _DISTANCE = 1, 2, 8  # entries of Bullet's contact points


def overlaps(game: Game, depth_m: float = GREATEST_OVERLAP_M) -> list[str]:
    """Return what penetrates each other by more than a depth, one entry for each pair.

    Bones of one body count, unless its joints keep them apart. Bullet's contacts are updated.

    Args:
        game: A game that has just been reset.
        depth_m: Greatest depth in metres that is no overlap.
    """
    names = _names(game)
    deepest: dict[tuple[str, str], float] = {}
    for one, other, distance_m in _contacts(game):
        pair = names[one], names[other]
        deepest[pair] = min(deepest.get(pair, 0.0), distance_m)
    return [
        f"{_described(*pair)} overlap by {-1000.0 * distance_m:.0f} mm"
        for pair, distance_m in deepest.items()
        if distance_m < -depth_m
    ]


def _names(game: Game) -> dict[int, str]:
    names = {player.body.body_id: player.name for player in game.players}
    names |= {prop.body_id: prop.name for prop in game.world.props.values()}
    return names | {game.world.floor_id: "floor"}


def _contacts(game: Game) -> Iterator[tuple[int, int, float]]:
    """Yield ids and distance of all contacts.

    Bullet looks for none between walkers and fixed props: neither has a mass.
    """
    client = game.world.client
    pybullet.performCollisionDetection(physicsClientId=client)
    points = list(pybullet.getContactPoints(physicsClientId=client))
    for one, other in _massless_pairs(game):
        points += pybullet.getClosestPoints(one, other, 0.0, physicsClientId=client)
    for point in points:
        yield point[_BODY_A], point[_BODY_B], point[_DISTANCE]


def _massless_pairs(game: Game) -> Iterator[tuple[int, int]]:
    walkers = [p.body.body_id for p in game.players if isinstance(p.body, Walker)]
    yield from combinations(walkers, 2)
    for walker in walkers:
        yield from ((walker, body_id) for body_id in _fixed(game.world))


def _fixed(world: World) -> list[int]:
    return [prop.body_id for prop in world.props.values() if prop.fixed and prop.cfg.tangible]


def _described(one: str, other: str) -> str:
    return f"bones of {one}" if one == other else f"{one} and {other}"
