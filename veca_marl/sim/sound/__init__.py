"""Sound: sources, waveforms, room acoustics and propagation."""

from veca_marl.sim.sound.house import House
from veca_marl.sim.sound.propagation import Receiver
from veca_marl.sim.sound.room_acoustics import NEAR_FIELD_M, SPEED_OF_SOUND_MPS, Room
from veca_marl.sim.sound.soundfield import Listener, SoundField
from veca_marl.sim.sound.sounds import (
    Clip,
    Noise,
    Pulses,
    Silence,
    Sound,
    SoundCfg,
    SoundKind,
    Source,
    Voice,
    make_sound,
)
from veca_marl.sim.sound.waveforms import (
    CALLS,
    SAMPLE_RATE_HZ,
    Call,
    CallCfg,
    Samples,
    buzz,
    call_waveform,
    tone,
)

__all__ = [
    "CALLS",
    "NEAR_FIELD_M",
    "SAMPLE_RATE_HZ",
    "SPEED_OF_SOUND_MPS",
    "Call",
    "CallCfg",
    "Clip",
    "House",
    "Listener",
    "Noise",
    "Pulses",
    "Receiver",
    "Room",
    "Samples",
    "Silence",
    "Sound",
    "SoundCfg",
    "SoundField",
    "SoundKind",
    "Source",
    "Voice",
    "buzz",
    "call_waveform",
    "make_sound",
    "tone",
]
