"""Development: the body and the senses of a child of an age, set at once.

What changes with the age, and what is known of it:

- *Body*: size, proportions, mass, strength, voice and gait, see
  `veca_marl.sim.body.anatomy.growth`.
- *Eyes*: acuity, contrast sensitivity and colour vision, see `veca_marl.sim.vision.image_filters`;
  their distance is the body's.
- *Ears*: thresholds of hearing, see `veca_marl.sim.hearing.infant_hearing`, and the size of the
  head, with which the ears' distance and the spectral features of the pinnae change.
- *Skin*: the skin of that body, with as many taxels, which lie closer together the smaller it is.
  The receptors of a child's fingers do so too, as their number stays while the skin grows
  (Peters & Goldreich, PLOS ONE 8 (2013) e84650, 6 to 16 years). Thresholds of touch are those of
  adults from 7 years on (Guclu & Oztek, J. Experimental Child Psychology 98 (2007) 113); of infants
  we know no measurement, and they are not changed.
"""

from __future__ import annotations

from dataclasses import replace

from veca_marl.envs.core.game_cfg import GameCfg, TeamCfg
from veca_marl.sim.body import BodyCfg
from veca_marl.sim.body.anatomy.growth import OLDEST_MONTHS, YOUNGEST_MONTHS
from veca_marl.sim.hearing import AudioCfg
from veca_marl.sim.senses import SensesCfg
from veca_marl.sim.vision import VisionCfg

CHILD_HEAD = 0.733
"""Size of the head of the body of 0.78 m relative to KEMAR's, see `AudioCfg.head_scale`."""


def check_age(age_months: float) -> None:
    """Raise `ValueError` if there is no body of an age."""
    if not YOUNGEST_MONTHS <= age_months <= OLDEST_MONTHS:
        raise ValueError(
            f"development={age_months} must be from {YOUNGEST_MONTHS:g} to {OLDEST_MONTHS:g} months"
        )


def at_age(cfg: GameCfg, age_months: float) -> GameCfg:
    """Return a game with the bodies and the senses of an age.

    A size, an age of the eyes or a size of the head that a configuration sets itself stays.

    Args:
        cfg: The game.
        age_months: From 1 to 36.
    """
    teams = {name: _team_at(team, age_months) for name, team in cfg.team.items()}
    return replace(
        cfg,
        body=_body_at(cfg.body, age_months),
        senses=_senses_at(cfg.senses, age_months),
        team=teams,
    )


def _team_at(team: TeamCfg, age_months: float) -> TeamCfg:
    body = None if team.body is None else _body_at(team.body, age_months)
    return replace(team, body=body, senses=_senses_at(team.senses, age_months))


def _body_at(body: BodyCfg, age_months: float) -> BodyCfg:
    if body.age_months is not None or body.height_m is not None:
        return body
    return replace(body, age_months=age_months)


def _senses_at(senses: SensesCfg, age_months: float) -> SensesCfg:
    vision = None if senses.vision is None else _vision_at(senses.vision, age_months)
    audio = None if senses.audio is None else _audio_at(senses.audio, age_months)
    return replace(senses, vision=vision, audio=audio)


def _vision_at(vision: VisionCfg, age_months: float) -> VisionCfg:
    if vision.infant_age_months is not None:
        return vision
    return replace(vision, infant_age_months=age_months)


def _audio_at(audio: AudioCfg, age_months: float) -> AudioCfg:
    """Return the ears of a child; those of a body of another size follow its head."""
    own = audio.infant_age_months
    return replace(
        audio,
        head_scale=CHILD_HEAD if audio.head_scale == 1.0 else audio.head_scale,
        infant_age_months=age_months if own is None else own,
    )
