"""Hearing: receivers, head-related transfer functions and the sense of hearing."""

from veca_marl.sim.hearing.audio_sense import AudioCfg, AudioQuality, AudioSense
from veca_marl.sim.hearing.conditioning import condition
from veca_marl.sim.hearing.encodings import Encoding, Noise, Window, log_spectrum
from veca_marl.sim.hearing.hrtf import HrtfTable, kemar_table, sofa_table
from veca_marl.sim.hearing.receivers import HrtfReceiver, MonoReceiver, StereoReceiver
from veca_marl.sim.hearing.sofa import read_sofa
from veca_marl.sim.hearing.sofa_file import SofaError
from veca_marl.sim.hearing.spatial_audio import get_spatial_audio

__all__ = [
    "AudioCfg",
    "AudioQuality",
    "AudioSense",
    "Encoding",
    "HrtfReceiver",
    "HrtfTable",
    "MonoReceiver",
    "Noise",
    "SofaError",
    "StereoReceiver",
    "Window",
    "condition",
    "kemar_table",
    "log_spectrum",
    "read_sofa",
    "sofa_table",
    "get_spatial_audio",
]
