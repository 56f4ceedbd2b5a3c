"""A check that a playground has a room for each agent."""

from __future__ import annotations

from veca_marl.sim.physics import PlaygroundCfg, RandomHouseCfg

_LEAST_AGENTS = 2
_RANDOM_HOUSE = "random_house"

ROOMS = {
    "two_rooms": 2,
    "three_rooms": 3,
    "four_rooms": 4,
    "house": 4,
    "seven_rooms": 7,
    "house2": 7,
}
"""Number of rooms of the playgrounds that have several."""


def check_rooms(playground: PlaygroundCfg, agents: int) -> None:
    """Check that a playground has a room for each agent.

    Raises:
        ValueError: If it has too few.
    """
    rooms = len(playground.rooms)
    if agents <= rooms:
        return
    raise ValueError(
        f"task.agents={agents} start in rooms of their own, but playground "
        f"{playground.name!r} has {rooms}; choose {' or '.join(_choices(rooms, agents))}"
    )


def _choices(rooms: int, agents: int) -> list[str]:
    """Return what to choose instead of a playground that has too few rooms for the agents."""
    larger = [name for name, count in ROOMS.items() if count >= agents]
    choices = [f"playground={', '.join(larger)}"] if larger else []
    if agents <= RandomHouseCfg(name=_RANDOM_HOUSE).most_rooms:
        choices.append(f"playground={_RANDOM_HOUSE} playground.room_count={agents}")
    if rooms >= _LEAST_AGENTS:
        return [*choices, f"task.agents of at most {rooms}"]
    if choices:
        return choices
    most = max(ROOMS.values())
    largest = ", ".join(name for name, count in ROOMS.items() if count == most)
    return [f"playground={largest} with task.agents of at most {most}"]
