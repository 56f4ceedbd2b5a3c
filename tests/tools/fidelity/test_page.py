"""The page of laws: verdicts, tables, pictures, and the exit status of the command."""

import math
import re

import pytest
from paths import ROOT
from refusals import naming

from tools.fidelity import command
from tools.fidelity.command import SECTIONS
from tools.fidelity.law import (
    Curve,
    Law,
    Mark,
    Plot,
    Section,
    at_least,
    at_most,
    between,
    equals,
)
from tools.fidelity.page import draw, picture_name, write_page
from veca_marl.override_text import quoted

HELD = equals("gravity", "m/s2", 9.81, 9.8, 0.02)
BROKEN = at_most("speed", "m/s", 1.0, 2.0)


@pytest.mark.parametrize(
    ("law", "holds"),
    [
        (equals("a", "m", 2.0, 2.1, 0.1), True),
        (equals("a", "m", 2.0, 2.11, 0.1), False),
        (equals("a", "m", 2.0, math.nan, 0.1), False),
        (at_most("a", "m", 1.0, 1.0), True),
        (at_most("a", "m", 1.0, 1.01), False),
        (at_most("a", "m", 1.0, math.nan), False),
        (at_least("a", "m", 1.0, 0.99), False),
        (at_least("a", "m", 1.0, 5.0), True),
        (between("a", "m", -1.0, 1.0, 0.0), True),
        (between("a", "m", -1.0, 1.0, -1.1), False),
    ],
)
def test_a_law_holds_in_its_interval(law, holds):
    assert law.holds is holds


def test_impossible_laws_and_sections_are_refused():
    with pytest.raises(ValueError, match="tolerance=-1"):
        equals("a", "m", 2.0, 2.0, -1.0)
    with pytest.raises(ValueError, match=naming("'a'", "[1.0, -1.0]")):
        Law("a", "m", 0.0, 1.0, -1.0)
    with pytest.raises(ValueError, match=naming("'Empty'")):
        Section("Empty", "", [])
    with pytest.raises(ValueError, match=naming("'Twice'", HELD.name)):
        Section("Twice", "", [HELD, HELD])
    with pytest.raises(ValueError, match=naming("'a'", "2 x", "1 y")):
        Curve("a", [1.0, 2.0], [1.0])


def test_the_page_has_a_row_for_each_law_and_a_picture_for_each_plot(tmp_path):
    plot = Plot(
        "Speed, in time",
        "time (s)",
        "speed (m/s)",
        [Curve("theory", [0.0, 1.0], [0.0, 1.0], Mark.dashes), Curve("", ["a", "b"], [1.0, 2.0])],
    )
    path = write_page(tmp_path / "new", {"fall": Section("Fall", "How.", [HELD, BROKEN], [plot])})
    text = path.read_text()
    assert "| gravity | 9.81 m/s2 | 9.8 m/s2 | ± 0.02 m/s2 | holds |" in text
    assert "| speed |  | 2 m/s | at most 1 m/s | **broken** |" in text
    assert "| Fall | 2 | speed |" in text
    (picture,) = re.findall(r"!\[Speed, in time\]\((.*)\)", text)
    assert (path.parent / picture).read_bytes().startswith(b"\x89PNG")


@pytest.mark.parametrize("mark", Mark)
def test_every_mark_is_drawn(tmp_path, mark):
    curves = [Curve("a", [1.0, 2.0], [1.0, 10.0], mark)]
    draw(tmp_path / "plot.png", Plot("t", "x", "y", curves, log_x=True, log_y=True))
    assert (tmp_path / "plot.png").stat().st_size > 2000


def test_the_exit_status_is_1_if_a_law_is_broken(tmp_path, monkeypatch, capsys):
    verdicts = {name: Section(name, "", [HELD]) for name in SECTIONS}
    monkeypatch.setattr(command, "measure_all", lambda names, _: verdicts)
    assert command.main([f"to={tmp_path}"]) == 0
    verdicts[next(iter(SECTIONS))] = Section("Bad", "", [HELD, BROKEN])
    assert command.main([f"to={tmp_path}"]) == 1
    name = next(iter(SECTIONS))
    error = capsys.readouterr().err
    assert all(part in error for part in (name, "speed", "2 m/s", "[-inf, 1]"))


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (["sections=[rigid_body]"], ("'rigid_body'", "rigid_bodies")),
        (["processes=-1"], ("processes", "-1")),
        (["seed=3"], ("seed=3", "sections", "processes")),
        (["too=x"], ("'too'", "sections")),
    ],
)
def test_bad_arguments_end_in_one_line(words, parts, capsys):
    assert command.main(words) == 2
    error = capsys.readouterr().err
    assert all(part in error for part in parts)
    assert error.count("\n") == 1


def test_the_committed_page_has_no_broken_law_and_all_its_pictures():
    """It is written by `make fidelity`."""
    docs = ROOT / "docs/reference"
    text = (docs / "fidelity.md").read_text()
    assert "**broken**" not in text
    assert len(re.findall("^## ", text, re.M)) == len(SECTIONS)
    for picture in re.findall(r"!\[.*\]\((.*)\)", text):
        assert (docs / picture).is_file()


def test_file_names_of_pictures_have_letters_digits_and_underscores_only():
    assert picture_name("fall", "Speed, in (m/s)") == "fall_speed_in_m_s.png"


@pytest.mark.parametrize(
    ("words", "parts"),
    [
        (["sections=[inertia]", f"to={quoted(__file__)}"], (f"to={__file__}",)),
        (["-m", "sections=[inertia],[momentum]", "to=laws"], ("to=laws", "2")),
        (["-m", "sections=[inertia],[momentum]"], ("folder", " to")),
    ],
)
def test_a_folder_that_cannot_take_the_page_is_refused_before_the_first_law(
    words, parts, capsys, monkeypatch
):
    monkeypatch.setattr(command, "measure_all", None)  # would be called
    assert command.main(words) == 2
    error = capsys.readouterr().err
    assert all(part in error for part in parts)
