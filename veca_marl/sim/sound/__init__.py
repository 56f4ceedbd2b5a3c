"""Sound: sources, waveforms, room acoustics and propagation."""

from veca_marl.sim.sound.calls import CALLS, Call, CallCfg, call_waveform
from veca_marl.sim.sound.propagation import Receiver
from veca_marl.sim.sound.rooms import NEAR_FIELD_M, SPEED_OF_SOUND_MPS, House, Room
from veca_marl.sim.sound.sound_cfg import SoundCfg, SoundKind, make_sound
from veca_marl.sim.sound.sound_source import Source
from veca_marl.sim.sound.soundfield import Listener, SoundField
from veca_marl.sim.sound.sounds import Clip, Noise, Pulses, Silence, Sound, Voice
from veca_marl.sim.sound.waveforms import SAMPLE_RATE_HZ, Samples, buzz, tone

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
