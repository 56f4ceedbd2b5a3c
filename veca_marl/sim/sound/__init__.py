"""Sound: sources, waveforms, room acoustics and propagation."""

from veca_marl.sim.sound.acoustics import NEAR_FIELD_M, SPEED_OF_SOUND_MPS, Room
from veca_marl.sim.sound.calls import CALLS, Call, CallCfg, call_waveform
from veca_marl.sim.sound.fractional_delay import KERNEL_TAPS, fractional_kernel, kernel_bank
from veca_marl.sim.sound.house import House
from veca_marl.sim.sound.receiver import Receiver, filter_length, lead_samples
from veca_marl.sim.sound.sound_source import Source
from veca_marl.sim.sound.soundfield import Listener, SoundField
from veca_marl.sim.sound.sounds import (
    Clip,
    Noise,
    Silence,
    Sound,
    SoundCfg,
    SoundKind,
    Voice,
    make_sound,
)
from veca_marl.sim.sound.waveforms import SAMPLE_RATE_HZ, Samples, buzz, tone

__all__ = [
    "CALLS",
    "KERNEL_TAPS",
    "NEAR_FIELD_M",
    "SAMPLE_RATE_HZ",
    "SPEED_OF_SOUND_MPS",
    "Call",
    "CallCfg",
    "Clip",
    "House",
    "Listener",
    "Noise",
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
    "filter_length",
    "fractional_kernel",
    "kernel_bank",
    "lead_samples",
    "make_sound",
    "tone",
]
