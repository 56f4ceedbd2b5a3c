import av
import numpy as np
import pytest
from refusals import naming

from veca_marl.runs.video import write_video

RATE, FPS = 22_050, 25


def film(frames, height=64, width=96):
    """A bright bar on black that moves by one pixel per frame."""
    pictures = np.zeros((frames, height, width, 3), np.uint8)
    for i, picture in enumerate(pictures):
        picture[:, i : i + 16] = 255
    return list(pictures)


def tone(seconds, left=440.0, right=880.0):
    t = np.arange(int(seconds * RATE)) / RATE
    return np.stack([np.sin(2 * np.pi * f * t) for f in (left, right)]).astype(np.float32)


def read(path):
    with av.open(str(path)) as container:
        pictures = [f.to_ndarray(format="rgb24") for f in container.decode(video=0)]
    with av.open(str(path)) as container:
        video, audio = container.streams.video[0], container.streams.audio
        kind = (video.codec_context.name, float(video.average_rate))
        sound = None
        if audio:
            kind += (audio[0].codec_context.name, audio[0].rate)
            sound = np.concatenate([f.to_ndarray() for f in container.decode(audio=0)], axis=1)
    return pictures, sound, kind


def pitch(signal):
    spectrum = np.abs(np.fft.rfft(signal * np.hanning(len(signal))))
    return np.argmax(spectrum) * RATE / len(signal)


def test_a_written_video_is_read_back(tmp_path):
    path = tmp_path / "deep" / "film.mp4"
    write_video(path, film(50), 0.1 * tone(2.0), FPS, RATE)
    pictures, sound, kind = read(path)
    assert kind[0] in ("h264", "mpeg4")
    assert kind[1:] == (FPS, "aac", RATE)
    assert len(pictures) == 50
    bar = pictures[30].mean((0, 2))
    assert bar[34:42].min() > 200, "the picture of this moment"
    assert bar[60:].max() < 60
    assert sound.shape[0] == 2
    assert sound.shape[1] / RATE == pytest.approx(2.0, abs=0.15)
    middle = sound[:, RATE // 2 : 3 * RATE // 2]
    assert pitch(middle[0]) == pytest.approx(440, abs=5), "left ear left"
    assert pitch(middle[1]) == pytest.approx(880, abs=5), "right ear right"
    assert np.abs(middle).max() == pytest.approx(0.8, abs=0.1), "loud enough, not clipped"


def test_the_level_difference_between_the_ears_is_kept(tmp_path):
    waveform = tone(1.0, 440.0, 440.0) * np.array([[1.0], [0.25]], np.float32)
    write_video(tmp_path / "film.mp4", film(25), waveform, FPS, RATE)
    _, sound, _ = read(tmp_path / "film.mp4")
    levels = sound[:, RATE // 4 : -RATE // 4].std(axis=1)
    assert levels[1] / levels[0] == pytest.approx(0.25, abs=0.03)


@pytest.mark.parametrize("waveform", [None, np.zeros((2, RATE), np.float32)])
def test_videos_without_sound_can_be_written(tmp_path, waveform):
    write_video(tmp_path / "film.mp4", film(25), waveform, FPS, RATE)
    pictures, sound, _ = read(tmp_path / "film.mp4")
    assert len(pictures) == 25
    assert sound is None if waveform is None else np.abs(sound).max() < 1e-3


@pytest.mark.parametrize(
    ("frames", "waveform", "parts"),
    [
        ([], None, ("video", "frame")),
        (film(2, height=63), None, ("frames", "(63, 96, 3)")),
        (
            [*film(1), film(1, width=64)[0]],
            None,
            ("frames", "uint8(64, 96, 3)", "uint8(64, 64, 3)"),
        ),
        (
            [f.astype(float) for f in film(1)],
            None,
            ("frames", "uint8(64, 96, 3)", "float64(64, 96, 3)"),
        ),
        (film(1), np.zeros(100, np.float32), ("waveform", "(100,)")),
        (film(1), np.full((2, 9), np.nan, np.float32), ("waveform", "finite")),
    ],
)
def test_impossible_videos_are_refused_and_leave_no_file(tmp_path, frames, waveform, parts):
    with pytest.raises(ValueError, match=naming(*parts)):
        write_video(tmp_path / "film.mp4", frames, waveform, FPS, RATE)
    assert not list(tmp_path.iterdir())


def test_a_failure_keeps_the_earlier_video(tmp_path, monkeypatch):
    path = tmp_path / "film.mp4"
    write_video(path, film(5), None, FPS, RATE)
    before = path.read_bytes()

    def fail(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("veca_marl.runs.video.VideoFile.add_picture", fail)
    with pytest.raises(OSError, match="No space left"):
        write_video(path, film(9), None, FPS, RATE)
    assert [p.name for p in tmp_path.iterdir()] == ["film.mp4"]
    assert path.read_bytes() == before
