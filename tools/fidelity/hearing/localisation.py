"""How well a small network finds the azimuth of a sound from one observation of each quality."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import torch

from tools.fidelity.law import Curve, Law, Mark, Plot, Section, at_least, at_most, between
from veca_marl.sim.geometry import Floats, Pose
from veca_marl.sim.hearing import AudioCfg, AudioQuality
from veca_marl.sim.hearing.audio_sense import make_receiver
from veca_marl.sim.hearing.encodings import WINDOW_SAMPLES, Encoding, make_encoder
from veca_marl.sim.sound import SAMPLE_RATE_HZ, Clip, Room, SoundField, buzz

_TEXT = """
The reason behind the audio ablation: what one observation `audio` tells about the direction of the
ball of KickTheBall. In the room of the playground `single_room` (first-order reflections) a
listener stands anywhere and faces anywhere; the ball buzzes on the floor, at least {near:g} m away.
A network with one hidden layer of {hidden} units learns sine and cosine of the azimuth from {train}
scenes; {test} others are its test. The same scenes are used for each quality.

- **Azimuth**: mean absolute error, 90 degrees for a random guess.
- **Front-back confusion**: fraction of scenes that are found in the wrong half, front or back,
  among those within 60 degrees of the median plane; 0.5 for a random guess.
- **Lateral angle**: mean absolute error of the angle to the median plane, which a front-back
  confusion leaves unchanged; 45 degrees if it is always found at 0.

The default observation contains magnitudes only: interaural times change it through the
interference of direct sound and reflections only, and `stereo` depends on how the distances to
both ears differ. Qualities with `_phase` are observed with
`senses.audio.encoding=magnitude_phase`: cosine and sine of the interaural phase show the time by
which one ear hears earlier.
"""
ARMS: dict[str, AudioCfg] = {
    "hrtf": AudioCfg(),
    "hrtf_child": AudioCfg(head_scale=0.733),
    "stereo": AudioCfg(quality=AudioQuality.stereo),
    "stereo_child": AudioCfg(quality=AudioQuality.stereo, head_scale=0.733),
    "mono": AudioCfg(quality=AudioQuality.mono),
    "hrtf_phase": AudioCfg(encoding=Encoding.magnitude_phase),
    "stereo_phase": AudioCfg(quality=AudioQuality.stereo, encoding=Encoding.magnitude_phase),
    "mono_phase": AudioCfg(quality=AudioQuality.mono, encoding=Encoding.magnitude_phase),
}
TRAIN, TEST = 2500, 500
_ROOM_LOWER_M, _ROOM_SIZE_M, _REFLECTION = (-3.0, -3.0, 0.0), (6.0, 6.0, 2.6), 0.6
_NEAREST_M, _TO_WALL_M = 0.5, 0.4
_EARS_M, _BALL_M = 0.66, 0.1
_STEPS = 3
_HIDDEN, _EPOCHS, _BATCH, _RATE, _DECAY = 128, 60, 50, 1e-3, 1e-3


@dataclass(frozen=True)
class Errors:
    """Errors of azimuths in degrees.

    Attributes:
        azimuth_deg: Mean absolute error.
        lateral_deg: Mean absolute error of the angle to the median plane.
        confused: Share of scenes in the wrong half, front or back.
    """

    azimuth_deg: float
    lateral_deg: float
    confused: float


def errors(found_rad: Floats, true_rad: Floats) -> Errors:
    """Return the errors of azimuths ``(n,)``."""
    difference = np.angle(np.exp(1j * (found_rad - true_rad)))
    lateral = np.arcsin(np.sin(found_rad)) - np.arcsin(np.sin(true_rad))
    medial = np.abs(np.cos(true_rad)) > 0.5
    wrong_half = np.cos(found_rad[medial]) * np.cos(true_rad[medial]) < 0.0
    return Errors(
        float(np.rad2deg(np.abs(difference).mean())),
        float(np.rad2deg(np.abs(lateral).mean())),
        float(wrong_half.mean()),
    )


def scenes(cfg: AudioCfg, count: int, seed: int) -> tuple[Floats, Floats]:
    """Return observations ``(count, features)`` of scenes, and azimuths ``(count,)`` in rad."""
    rng = np.random.default_rng(seed)
    field = SoundField(Room(_ROOM_LOWER_M, _ROOM_SIZE_M, _REFLECTION), image_order=1)
    ball = field.add_source("ball", Clip(buzz(150.0, 0.1, SAMPLE_RATE_HZ), loop=True))
    listener = field.add_listener(make_receiver(cfg, SAMPLE_RATE_HZ))
    encoder = make_encoder(cfg.encoding, cfg.window, cfg.noise_floor_db, cfg.bins)
    heard, azimuths = np.empty((count, math.prod(encoder.spec.shape))), np.empty(count)
    for i in range(count):
        position, head, azimuths[i] = _place(rng)
        field.reset(np.random.default_rng(rng.integers(2**63)))
        ball.position = position
        recent = []
        for _ in range(_STEPS):
            field.advance()
            recent.append(listener.render(head))
        heard[i] = encoder.encode(np.concatenate(recent, axis=1)[:, -WINDOW_SAMPLES:]).ravel()
    return heard, azimuths


def localisation(cfg: AudioCfg, train: int = TRAIN, test: int = TEST) -> Errors:
    """Train the network on scenes of one quality; return its errors on others."""
    observations, azimuths = scenes(cfg, train + test, seed=0)
    mean, std = observations[:train].mean(axis=0), observations[:train].std() + 1e-9
    inputs = torch.as_tensor((observations - mean) / std, dtype=torch.float32)
    directions = np.stack([np.cos(azimuths), np.sin(azimuths)], axis=1)
    targets = torch.as_tensor(directions, dtype=torch.float32)
    with torch.random.fork_rng(devices=[]):
        torch.manual_seed(0)
        network = _trained(inputs[:train], targets[:train])
    with torch.no_grad():
        cosine, sine = network(inputs[train:]).double().numpy().T
    return errors(np.arctan2(sine, cosine), azimuths[train:])


def section() -> Section:
    """Measure all of this page."""
    found = {name: localisation(cfg) for name, cfg in ARMS.items()}
    text = _TEXT.format(near=_NEAREST_M, hidden=_HIDDEN, train=TRAIN, test=TEST)
    return Section("Localisation by ear", text, _laws(found), _plots(found))


def _place(rng: np.random.Generator) -> tuple[Floats, Pose, float]:
    """Return the positions of a ball and a head, and the azimuth of the ball in the head frame."""
    low = np.array(_ROOM_LOWER_M[:2]) + _TO_WALL_M
    high = np.array(_ROOM_LOWER_M[:2]) + np.array(_ROOM_SIZE_M[:2]) - _TO_WALL_M
    way = np.zeros(2)
    while np.hypot(*way) < _NEAREST_M:
        ears, ball = rng.uniform(low, high), rng.uniform(low, high)
        way = ball - ears
    yaw = rng.uniform(-np.pi, np.pi)
    c, s = np.cos(yaw), np.sin(yaw)
    head = Pose(np.append(ears, _EARS_M), np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]]))
    azimuth = float(np.angle(np.exp(1j * (np.arctan2(way[1], way[0]) - yaw))))
    return np.append(ball, _BALL_M), head, azimuth


def _trained(inputs: torch.Tensor, targets: torch.Tensor) -> torch.nn.Module:
    network = torch.nn.Sequential(
        torch.nn.Linear(inputs.shape[1], _HIDDEN), torch.nn.Tanh(), torch.nn.Linear(_HIDDEN, 2)
    )
    optimiser = torch.optim.AdamW(network.parameters(), _RATE, weight_decay=_DECAY)
    for _ in range(_EPOCHS):
        for batch in torch.randperm(len(inputs)).split(_BATCH):
            loss = torch.nn.functional.mse_loss(network(inputs[batch]), targets[batch])
            optimiser.zero_grad()
            loss.backward()
            optimiser.step()
    return network


def _laws(found: dict[str, Errors]) -> list[Law]:
    hrtf, stereo, mono = found["hrtf"], found["stereo"], found["mono"]
    phase = {name: found[f"{name}_phase"] for name in ("hrtf", "stereo", "mono")}
    return [
        at_most("hrtf, error of azimuth", "deg", 30.0, hrtf.azimuth_deg),
        at_most("hrtf, front-back confusion", "", 0.25, hrtf.confused),
        at_least("stereo, error of azimuth", "deg", 45.0, stereo.azimuth_deg),
        at_most(
            "stereo, error of azimuth, below mono", "deg", mono.azimuth_deg, stereo.azimuth_deg
        ),
        between("stereo, front-back confusion", "", 0.35, 0.65, stereo.confused),
        at_least("mono, error of azimuth", "deg", 75.0, mono.azimuth_deg),
        between("mono, front-back confusion", "", 0.35, 0.65, mono.confused),
        at_most("hrtf with phase, error of azimuth", "deg", 30.0, phase["hrtf"].azimuth_deg),
        at_most(
            "stereo with phase, error of the lateral angle",
            "deg",
            25.0,
            phase["stereo"].lateral_deg,
        ),
        between(
            "stereo with phase, front-back confusion", "", 0.35, 0.65, phase["stereo"].confused
        ),
        at_least("mono with phase, error of azimuth", "deg", 75.0, phase["mono"].azimuth_deg),
    ]


def _plots(found: dict[str, Errors]) -> list[Plot]:
    names = list(found)
    azimuth, lateral, confused = (
        [getattr(error, key) for error in found.values()]
        for key in ("azimuth_deg", "lateral_deg", "confused")
    )
    return [
        Plot(
            "Error of localisation",
            "quality",
            "mean absolute error (degrees)",
            [
                Curve("azimuth", names, azimuth, Mark.bars),
                Curve("lateral angle", names, lateral, Mark.bars),
            ],
        ),
        Plot("Front-back confusion", "quality", "share", [Curve("", names, confused, Mark.bars)]),
    ]
