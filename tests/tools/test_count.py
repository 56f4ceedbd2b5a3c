"""Counts of a made-up package."""

import subprocess
from fractions import Fraction

import pytest

from tools import count, counting

GAME = '''"""A game.

Two paragraphs.
"""

from __future__ import annotations

import math
from toy.parts import (
    ball,
    Wall,
)

LIMIT = 3
"""A documented number."""


def play(n):  # a comment
    """Play."""

    def inner():
        return math.pi

    text = """not
a docstring"""
    return inner(), text, ball, Wall
'''
SOURCES = {
    "toy/__init__.py": '"""Toys."""\n',
    "toy/game.py": GAME,
    "toy/parts/__init__.py": "from toy.parts.ball import Ball\nfrom toy.parts.wall import Wall\n",
    "toy/parts/ball.py": "import toy.parts.wall\n\n\nclass Ball:\n    pass\n",
    "toy/parts/wall.py": "from . import ball\nfrom .. import game\nfrom ..game import play\nN=1\n",
    "toy/parts/deep/er/game.py": "x = 1\n",
}


@pytest.fixture
def modules():
    return counting.read_modules(SOURCES)


@pytest.fixture
def by_path(modules):
    return {str(module.path): module for module in modules}


def test_lines_are_without_blank_lines_comments_and_docstrings(by_path):
    # 6 of imports, LIMIT, def, inner with its body, 2 of text, return
    assert by_path["toy/game.py"].lines == 13
    assert by_path["toy/__init__.py"].lines == 0


def test_imports_of_the_package_are_told_from_others(by_path):
    game = by_path["toy/game.py"]
    assert (game.import_lines, game.own_import_lines) == (6, 4)


def test_imported_modules_are_found_in_every_form(by_path):
    own = {path: module.own for path, module in by_path.items()}
    assert own["toy/game.py"] == {"toy.parts", "toy.parts.ball"}
    assert own["toy/parts/__init__.py"] == {"toy.parts.ball", "toy.parts.wall"}
    assert own["toy/parts/ball.py"] == {"toy.parts.wall"}
    assert own["toy/parts/wall.py"] == {"toy.parts.ball", "toy.game"}
    assert own["toy/parts/deep/er/game.py"] == set()


def test_functions_have_the_lines_of_those_inside(modules):
    assert counting.function_lines(modules) == [2, 6]


def test_folders_are_those_with_modules_of_their_own(modules):
    assert counting.folders(modules) == 3


def test_subpackages_contain_what_is_deeper(modules):
    sizes = counting.subpackages(modules)
    assert sizes == {"toy.parts": counting.Size(4, 10), "toy.parts.deep": counting.Size(1, 1)}
    assert list(counting.subpackages(modules, levels=3)) == [
        "toy.parts",
        "toy.parts.deep",
        "toy.parts.deep.er",
    ]


def test_means_and_fractions(modules):
    assert counting.size(modules) == counting.Size(6, 23)
    assert counting.import_fraction(modules) == pytest.approx(12 / 23)
    assert counting.own_imports(modules) == pytest.approx(7 / 6)
    assert counting.own_imports_of_importers(modules) == pytest.approx(7 / 4)
    assert counting.own_import_lines(modules) == pytest.approx(10 / 6)


def test_small_modules_and_namesakes_leave_out_init_files(modules):
    assert counting.small(modules) == (4, 1.0)
    assert counting.namesakes(modules) == 2


def test_the_largest_module_is_the_first(modules):
    assert [module.lines for module in counting.largest(modules, 2)] == [13, 4]


def test_percentiles_are_values_of_the_sample():
    values = list(range(1, 11))
    assert counting.percentile(values, Fraction(1, 2)) == 5
    assert counting.percentile(values, Fraction(9, 10)) == 9
    assert counting.percentile(values, Fraction(1)) == 10
    assert counting.percentile([7], Fraction(1, 100)) == 7


@pytest.mark.parametrize(("values", "fraction"), [([], Fraction(1, 2)), ([1], Fraction(0))])
def test_impossible_percentiles_are_refused(values, fraction):
    with pytest.raises(ValueError):  # noqa: PT011  the wording is free
        counting.percentile(values, fraction)


def test_a_package_without_modules_is_refused():
    with pytest.raises(ValueError):  # noqa: PT011  the wording is free
        counting.read_modules({})


@pytest.fixture
def repository(tmp_path):
    """A repository with one commit of the package, to which a module was added afterwards."""
    for path, text in SOURCES.items():
        (tmp_path / path).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / path).write_text(text)
    (tmp_path / "toy/data.bin").write_bytes(b"\xff\xfe")
    git = ["git", "-C", str(tmp_path), "-c", "user.name=x", "-c", "user.email=x@example.org"]
    for words in (["init", "--quiet"], ["add", "."], ["commit", "--quiet", "-m", "toys"]):
        subprocess.run([*git, *words], check=True)
    (tmp_path / "toy/new.py").write_text("y = 2\n")
    return tmp_path


def test_a_commit_is_read_without_being_checked_out(repository):
    assert count.sources_of_commit(repository, "toy", "HEAD") == SOURCES
    now = count.sources_of_checkout(repository, "toy")
    assert now == {**SOURCES, "toy/new.py": "y = 2\n"}


def test_an_unknown_commit_is_refused(repository):
    with pytest.raises(count.GitError):
        count.sources_of_commit(repository, "toy", "nothing")


def test_the_report_has_both_columns(modules):
    less = counting.read_modules({"toy/__init__.py": "", "toy/parts/one.py": "x = 1\n"})
    lines = count.report({"before": modules, "now": less}, 3)
    assert lines[1].split() == ["modules", "6", "2"]
    part = next(line for line in lines if line.startswith("toy.parts "))
    assert part.split() == ["toy.parts", "4", "10", "1", "1"]
    assert next(line for line in lines if line.startswith("toy.parts.deep")).endswith("-")
