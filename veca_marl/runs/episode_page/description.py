"""An episode as a description in JSON and arrays, and back."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from veca_marl.runs.episode_page.body_chart import chart_pose
from veca_marl.runs.episode_page.episode import Agent, Episode, Geometry, Repainting, SceneInfo
from veca_marl.runs.episode_page.media import sound_file
from veca_marl.runs.episode_page.packing import Packer, unpack
from veca_marl.sim.geometry import Mesh
from veca_marl.sim.touch.taxels import BARYCENTRIC
from veca_marl.sim.vision.shading import AMBIENT, DARK_TILE, GLASS_OPACITY, SUN
from veca_marl.version import __version__

FORMAT = 1
POSITION_UNIT_M = 1e-4
QUATERNION_UNIT = 1.0 / 16384.0
ACTION_UNIT = 1e-4


def describe(episode: Episode, packer: Packer) -> dict[str, Any]:
    """Return the description of an episode, in values of JSON; its arrays go to the packer."""
    scene = episode.scene
    packer.add_plain("colours", scene.colours.astype(np.float32))
    packer.add_plain("chart", chart_pose().astype(np.float32))
    return {
        "format": FORMAT,
        "version": __version__,
        "title": episode.title,
        "details": {name: str(value) for name, value in episode.details.items()},
        "stepS": episode.step_s,
        "steps": episode.steps,
        "isCut": episode.is_cut,
        "sampleRate": episode.sample_rate_hz,
        "light": {"sun": SUN, "ambient": AMBIENT, "tile": DARK_TILE, "glass": GLASS_OPACITY},
        "taxels": BARYCENTRIC.tolist(),
        "objects": scene.objects,
        "firstFrames": scene.first_frames,
        "firstTriangles": scene.first_triangles,
        "rooms": scene.rooms.tolist(),
        "geometries": [_describe_geometry(geometry) for geometry in scene.geometries],
        "skins": _describe_skins(scene, packer),
        "motion": _describe_motion(episode, packer),
        "repaintings": [
            {"step": each.step, "surfaces": each.surfaces, "colours": each.colours}
            for each in episode.repaintings
        ],
        "agents": [
            _describe_agent(f"agents/{number}", agent, episode, packer)
            for number, agent in enumerate(episode.agents)
        ],
    }


def _describe_geometry(geometry: Geometry) -> dict[str, Any]:
    return {
        "shape": geometry.shape,
        "size": [round(value, 6) for value in geometry.size],
        "surface": geometry.surface,
        "frame": geometry.frame,
        "object": geometry.object,
        "offset": _rounded(geometry.offset),
        "rotation": _rounded(geometry.rotation),
        "checker": round(geometry.checker_m, 6),
        "transparent": geometry.transparent,
        "corners": _rounded(geometry.corners),
    }


def _rounded(values: NDArray[np.float64]) -> list[Any]:
    rounded: list[Any] = np.round(values, 6).tolist()
    return rounded


def _describe_skins(scene: SceneInfo, packer: Packer) -> list[dict[str, Any]]:
    """Store each different mesh once; the colours of triangles are those of the surfaces."""
    names: dict[bytes, str] = {}
    skins = []
    for number, mesh in scene.skins.items():
        arrays: dict[str, NDArray[Any]] = {
            "frames": mesh.frames.astype(np.uint16),
            "weights": mesh.weights.astype(np.float32),
            "offsets": mesh.offsets.astype(np.float32),
            "triangles": mesh.triangles.astype(np.uint16 if len(mesh.frames) < 2**16 else np.int32),
            "owners": mesh.owners.astype(np.uint16),
        }
        content = b"".join(array.tobytes() for array in arrays.values())
        if content not in names:
            names[content] = f"meshes/{len(names)}"
            for name, array in arrays.items():
                packer.add_plain(f"{names[content]}/{name}", array)
        skins.append({"object": number, "mesh": names[content]})
    return skins


def _describe_motion(episode: Episode, packer: Packer) -> dict[str, Any]:
    """Store the poses of frames that move for all steps, those of the others once."""
    p = np.rint(episode.positions / POSITION_UNIT_M)
    q = np.rint(episode.quaternions / QUATERNION_UNIT)
    moves = (p != p[0]).any(axis=(0, 2)) | (q != q[0]).any(axis=(0, 2))
    for name, frames in (("moving", moves), ("still", ~moves)):
        last = None if name == "moving" else 1
        packer.add_quantised(f"{name}/positions", episode.positions[:last, frames], POSITION_UNIT_M)
        packer.add_quantised(
            f"{name}/quaternions", episode.quaternions[:last, frames], QUATERNION_UNIT
        )
    return {
        "moving": np.flatnonzero(moves).tolist(),
        "still": np.flatnonzero(~moves).tolist(),
    }


def _describe_agent(at: str, agent: Agent, episode: Episode, packer: Packer) -> dict[str, Any]:
    described: dict[str, Any] = {
        "name": agent.name,
        "team": agent.team,
        "object": agent.object,
        "hiddenFrames": agent.hidden_frames,
        "firstEye": agent.first_eye,
        "fov": agent.fov_deg,
        "terms": [],
        "actions": [],
    }
    if agent.pictures is not None:
        sheets = [f"{at}/sheet{number}" for number in range(len(agent.pictures))]
        for name, content in zip(sheets, agent.pictures, strict=True):
            packer.add_media(name, content)
        described["eyes"] = {
            "sheets": sheets,
            "height": agent.picture_size[0],
            "width": agent.picture_size[1],
            "steps": agent.sheet_steps,
        }
    if agent.touch is not None:
        counts = np.array([len(taxels) for taxels, _ in agent.touch])
        packer.add_quantised(f"{at}/touched", counts, 1.0)
        packer.add_plain(f"{at}/taxels", np.concatenate([taxels for taxels, _ in agent.touch]))
        packer.add_plain(f"{at}/readings", np.concatenate([levels for _, levels in agent.touch]))
        described["touch"] = True
    if agent.waveform is not None and agent.waveform.size:
        content, kind = sound_file(agent.waveform, episode.sample_rate_hz)
        packer.add_media(f"{at}/sound", content)
        described["sound"] = {"name": f"{at}/sound", "type": kind}
    for number, (term, values) in enumerate(agent.terms.items()):
        packer.add_plain(f"{at}/term{number}", values.astype(np.float32))
        described["terms"].append({"name": term, "array": f"{at}/term{number}"})
    for number, (part, values) in enumerate(agent.actions.items()):
        packer.add_quantised(f"{at}/action{number}", values, ACTION_UNIT)
        names, choices = agent.action_names[part], agent.choices.get(part)
        described["actions"].append(
            {"part": part, "names": names, "choices": choices, "array": f"{at}/action{number}"}
        )
    if agent.solved is not None:
        packer.add_plain(f"{at}/solved", agent.solved.astype(np.uint8))
        described["solved"] = f"{at}/solved"
    return described


class _Arrays:
    """Reads the arrays of a page by name."""

    def __init__(self, entries: Mapping[str, Mapping[str, Any]], block: bytes) -> None:
        self._entries, self._block = entries, block

    def __call__(self, name: str) -> NDArray[Any]:
        return unpack(self._entries, self._block, name)


def restore(description: dict[str, Any], block: bytes) -> Episode:
    """Return the episode of a description, without its sounds.

    Args:
        description: From `describe`, with the entries of the packer as `arrays`.
        block: The packer's.

    Raises:
        PackingError: If an array is damaged.
        KeyError: If something is missing; also `TypeError`, `ValueError`.
    """
    read = _Arrays(description["arrays"], block)
    positions, quaternions = _read_motion(description, read)
    scene = SceneInfo(
        [str(name) for name in description["objects"]],
        [_read_geometry(each) for each in description["geometries"]],
        {int(each["object"]): _read_skin(each, description, read) for each in description["skins"]},
        [int(first) for first in description["firstFrames"]],
        [int(first) for first in description["firstTriangles"]],
        read("colours"),
        np.array(description["rooms"], np.float64).reshape(-1, 2, 3),
    )
    return Episode(
        str(description["title"]),
        dict(description["details"]),
        float(description["stepS"]),
        int(description["sampleRate"]),
        scene,
        positions,
        quaternions,
        [
            Repainting(each["step"], each["surfaces"], each["colours"])
            for each in description["repaintings"]
        ],
        [_read_agent(f"agents/{n}", each, read) for n, each in enumerate(description["agents"])],
        bool(description["isCut"]),
    )


def _read_motion(
    description: dict[str, Any], read: _Arrays
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    motion, steps = description["motion"], int(description["steps"])
    frames = len(motion["moving"]) + len(motion["still"])
    positions, quaternions = np.zeros((steps + 1, frames, 3)), np.zeros((steps + 1, frames, 4))
    for name in ("moving", "still"):
        if motion[name]:
            positions[:, motion[name]] = read(f"{name}/positions")
            quaternions[:, motion[name]] = read(f"{name}/quaternions")
    return positions, quaternions / np.linalg.norm(quaternions, axis=2, keepdims=True)


def _read_geometry(stored: dict[str, Any]) -> Geometry:
    return Geometry(
        str(stored["shape"]),
        tuple(float(value) for value in stored["size"]),
        int(stored["surface"]),
        int(stored["frame"]),
        int(stored["object"]),
        np.array(stored["offset"], np.float64),
        np.array(stored["rotation"], np.float64),
        float(stored["checker"]),
        bool(stored["transparent"]),
        np.array(stored["corners"], np.float64).reshape(-1, 3, 3),
    )


def _read_skin(stored: dict[str, Any], description: dict[str, Any], read: _Arrays) -> Mesh:
    at = stored["mesh"]
    triangles = read(f"{at}/triangles").astype(np.int64)
    first = int(description["firstTriangles"][stored["object"]])
    weights = read(f"{at}/weights").astype(np.float64)
    return Mesh(
        frames=read(f"{at}/frames").astype(np.int64),
        weights=weights,
        offsets=read(f"{at}/offsets").astype(np.float64),
        triangles=triangles,
        owners=read(f"{at}/owners").astype(np.int64),
        colours=read("colours")[first : first + len(triangles)],
    )


def _read_agent(at: str, stored: dict[str, Any], read: _Arrays) -> Agent:
    agent = Agent(
        stored["name"],
        stored["team"],
        int(stored["object"]),
        list(stored["hiddenFrames"]),
        int(stored["firstEye"]),
        float(stored["fov"]),
        terms={each["name"]: read(each["array"]).astype(float) for each in stored["terms"]},
        actions={each["part"]: read(each["array"]) for each in stored["actions"]},
        action_names={each["part"]: each["names"] for each in stored["actions"]},
        choices={each["part"]: each["choices"] for each in stored["actions"] if each["choices"]},
    )
    eyes = stored.get("eyes")
    if eyes:
        agent.pictures = [read(name).tobytes() for name in eyes["sheets"]]
        agent.picture_size = (int(eyes["height"]), int(eyes["width"]))
        agent.sheet_steps = int(eyes["steps"])
    if stored.get("touch"):
        ends = np.cumsum(read(f"{at}/touched").astype(np.int64))[:-1]
        taxels, levels = (np.split(read(f"{at}/{name}"), ends) for name in ("taxels", "readings"))
        agent.touch = list(zip(taxels, levels, strict=True))
    if "solved" in stored:
        agent.solved = read(stored["solved"]).astype(bool)
    return agent
