"""What a page shows of an episode, as data: the scene, its motion, and what the agents sensed."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from veca_marl.sim.geometry import Floats, Mesh

Bytes = NDArray[np.uint8]


@dataclass(frozen=True, eq=False)
class Geometry:
    """One visible primitive on a frame of the scene.

    Attributes:
        shape: `sphere`, `box`, `cylinder`, `capsule` or `polyhedron`.
        size: Metres, as in `Primitive.size`.
        surface: Row of its colour among all surfaces of the scene.
        frame: Row of its frame.
        object: Number of its object.
        offset: ``(3,)`` metres on the frame.
        rotation: ``(3, 3)`` from its axes to the frame's.
        checker_m: Edge of a checker pattern; 0 without one.
        transparent: Whether it tints what lies behind it.
        corners: Corners ``(T, 3, 3)`` of the triangles of a polyhedron, metres; else empty.
    """

    shape: str
    size: tuple[float, ...]
    surface: int
    frame: int
    object: int
    offset: Floats
    rotation: Floats
    checker_m: float
    transparent: bool
    corners: Floats


@dataclass(frozen=True, eq=False)
class SceneInfo:
    """What does not move.

    Attributes:
        objects: Names of the objects.
        geometries: The visible primitives.
        skins: Mesh of each object that has one, by its number; indices of frames among its own.
        first_frames: First frame of each object.
        first_triangles: First surface of the triangles of each object.
        colours: ``(S, 3)`` of all surfaces at the start.
        rooms: Corners ``(R, 2, 3)`` of the rooms, metres.
    """

    objects: list[str]
    geometries: list[Geometry]
    skins: dict[int, Mesh]
    first_frames: list[int]
    first_triangles: list[int]
    colours: NDArray[np.float32]
    rooms: Floats


@dataclass(frozen=True)
class Repainting:
    """A change of colours at a step.

    Attributes:
        step: The step, from 0 on.
        surfaces: Rows of the surfaces.
        colours: Red, green and blue of each.
    """

    step: int
    surfaces: list[int]
    colours: list[list[float]]


@dataclass
class Agent:
    """What one player sensed and did; senses that it lacks are None.

    N is the number of steps; senses have the start as well.

    Attributes:
        name: Its name.
        team: Its team.
        object: Number of its body among the objects.
        hidden_frames: Frames of its body that its own eyes do not see.
        first_eye: The first of the two frames, after those of the scene, which are its eyes.
        fov_deg: Vertical field of view of its eyes.
        pictures: Sheets of pictures as WebP files, each of up to `sheet_steps` rows with both eyes.
        picture_size: Height and width of a picture.
        sheet_steps: Steps on a sheet.
        touch: For each of N + 1 steps the taxels in contact and their readings, 1 to 255.
        waveform: ``(2, samples)`` at its ears.
        terms: ``(N,)`` of each reward term, weight included.
        actions: ``(N, values)`` of each part of its action.
        action_names: Name of each value of each part.
        choices: Names of the choices of the parts that are one.
        solved: ``(N,)`` whether the goal was reached.
    """

    name: str
    team: str
    object: int
    hidden_frames: list[int]
    first_eye: int
    fov_deg: float = 60.0
    pictures: list[bytes] | None = None
    picture_size: tuple[int, int] = (0, 0)
    sheet_steps: int = 25
    touch: list[tuple[NDArray[np.uint16], Bytes]] | None = None
    waveform: NDArray[np.float32] | None = None
    terms: dict[str, Floats] = field(default_factory=dict)
    actions: dict[str, Floats] = field(default_factory=dict)
    action_names: dict[str, list[str]] = field(default_factory=dict)
    choices: dict[str, list[str]] = field(default_factory=dict)
    solved: NDArray[np.bool_] | None = None


@dataclass
class Episode:
    """A recorded episode.

    F is the number of frames: those of the scene, then two for the eyes of each agent.

    Attributes:
        title: What was played.
        details: Further lines, such as the policy and the seed, by name.
        step_s: Length of a step in seconds.
        sample_rate_hz: Of the sounds.
        scene: What does not move.
        positions: ``(N + 1, F, 3)`` metres.
        quaternions: ``(N + 1, F, 4)`` unit (x, y, z, w), from the axes of the frame to the world's.
        repaintings: Changes of colours.
        agents: The players.
        is_cut: Whether the episode went on after the last step of the recording.
    """

    title: str
    details: dict[str, Any]
    step_s: float
    sample_rate_hz: int
    scene: SceneInfo
    positions: Floats
    quaternions: Floats
    repaintings: list[Repainting]
    agents: list[Agent]
    is_cut: bool = False

    @property
    def steps(self) -> int:
        """Number of steps, the start left out."""
        return len(self.positions) - 1
