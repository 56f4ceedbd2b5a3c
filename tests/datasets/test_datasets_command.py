"""The commands on data sets: words in, one line of error or a data set out."""

import wave

import numpy as np
import pytest

from veca_marl.datasets.card import write_wav
from veca_marl.datasets.command import COMMANDS, main
from veca_marl.datasets.dataset import DATASETS


def error_of(capsys, *words):
    """Return the line that a command ends with."""
    assert main(list(words)) == 2
    printed = capsys.readouterr().err.strip()
    assert "\n" not in printed
    assert printed.startswith("error: ")
    return printed


def test_a_set_is_made_shown_and_learnt_from(tmp_path, capsys):
    out, table = tmp_path / "set", tmp_path / "scores.json"
    words = ["+dataset=object_recognition", "n=20", f"out={out}", "progress=false"]
    assert main(["make", *words]) == 0
    first = capsys.readouterr().out
    assert main(["make", *words]) == 0
    assert capsys.readouterr().out == first
    assert main(["show", f"data={out}", "verify=true"]) == 0
    shown = capsys.readouterr().out
    assert all(part in shown for part in ("20 samples", "box", "image", "checksums agree"))
    training = [f"data={out}", "epochs=1", "runs=1", "progress=false", f"json={table}"]
    assert main(["train", *training]) == 0
    assert "76.1 %" in capsys.readouterr().out
    assert table.exists()
    readme = (out / "README.md").read_text()
    assert "make +dataset=object_recognition n=20 seed=0" in readme
    linked = [part.partition(")")[0] for part in readme.split("](")[1:]]
    assert all((out / path).is_file() for path in linked)


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (["make"], ("+dataset=NAME", "sound_localisation")),
        (["make", "+dataset=sounds"], ("'sounds'", "sound_localisation")),
        (["make", "+dataset=sound_localisation", "n=0"], ("n", "0")),
        (["make", "+dataset=sound_localisation", "seed=-1"], ("seed", "-1")),
        (["make", "+dataset=sound_localisation", "processes=0"], ("processes", "0")),
        (["make", "+dataset=sound_localisation", "m=3"], ("'m'", "seed", "senses")),
        (["make", "+dataset=sound_localisation", "dataset.loud=3"], ("loud", "level_db")),
        (["make", "+dataset=sound_localisation", "dataset.tilt_deg=200"], ("tilt_deg", "200")),
        (["make", "+dataset=sound_localisation", "dataset.head_m=[1]"], ("head_m", "2")),
        (["make", "+dataset=sound_localisation", "dataset.head_m=[2,1]"], ("head_m", "order")),
        (["make", "+dataset=sound_localisation", "dataset.head_m=[1,3]"], ("head_m", "ceiling")),
        (["make", "+dataset=sound_localisation", "senses/audio=deaf"], ("audio", "not present")),
        (["make", "+dataset=sound_localisation", "senses/audio=loud"], ("'loud'", "mono")),
        (["make", "+dataset=object_recognition", "dataset.least_pixels=99999"], ("99999",)),
        (["train", "+dataset=sound_localisation", "epochs=0"], ("epochs", "0")),
        (["train", "data=nowhere"], ("nowhere",)),
        (["show", "data=nowhere"], ("nowhere",)),
        (["mak"], ("'mak'", "make", "show", "train")),
    ],
)
def test_errors_are_one_line_with_the_value_and_the_choices(
    words, parts, capsys, tmp_path, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    printed = error_of(capsys, *words)
    assert all(part in printed for part in parts)
    assert not list(tmp_path.iterdir())


def test_settings_that_no_scene_meets_are_named(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("veca_marl.datasets.kinds.images.TRIES", 20)
    words = ["+dataset=object_recognition", "dataset.distance_m=[4,4]", "dataset.width_m=[0.1,0.1]"]
    printed = error_of(capsys, "make", *words, "n=1", f"out={tmp_path / 'set'}", "progress=false")
    assert "object_recognition" in printed


@pytest.mark.parametrize("command", COMMANDS)
def test_every_command_has_help_of_one_screen(command, capsys):
    assert main([command, "--help"]) == 0
    assert len(capsys.readouterr().out.splitlines()) <= 60


def test_the_help_lists_commands_and_data_sets(capsys):
    assert main(["--help"]) == 0
    printed = capsys.readouterr().out
    assert all(name in printed for name in [*COMMANDS, *DATASETS])
    assert main(["--version"]) == 0


def test_a_sound_keeps_its_ears_and_uses_the_full_scale(tmp_path):
    waveform = np.stack([np.linspace(-0.01, 0.01, 100), np.zeros(100)])
    write_wav(tmp_path / "a.wav", waveform)
    with wave.open(str(tmp_path / "a.wav")) as file:
        assert (file.getnchannels(), file.getframerate(), file.getnframes()) == (2, 22050, 100)
        samples = np.frombuffer(file.readframes(100), "<i2").reshape(-1, 2)
    assert abs(int(samples[:, 0].max()) - 29490) <= 1
    assert not samples[:, 1].any()
