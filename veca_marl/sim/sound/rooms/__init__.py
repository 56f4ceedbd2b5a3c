"""Rooms: image sources, walls and obstacles."""

from veca_marl.sim.sound.obstacles import Obstacles
from veca_marl.sim.sound.room_acoustics import NEAR_FIELD_M, SPEED_OF_SOUND_MPS, Room
from veca_marl.sim.sound.rooms.house import TRANSMISSION_LOSS_DB, House
from veca_marl.sim.sound.surroundings import Arrivals, FreeField, OneRoom, Surroundings

__all__ = [
    "NEAR_FIELD_M",
    "SPEED_OF_SOUND_MPS",
    "TRANSMISSION_LOSS_DB",
    "Arrivals",
    "FreeField",
    "House",
    "Obstacles",
    "OneRoom",
    "Room",
    "Surroundings",
]
