"""Sound: sources, waveforms, room acoustics and propagation."""
