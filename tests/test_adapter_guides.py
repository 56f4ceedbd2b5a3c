"""The snippets of docs/guides/other_libraries.md run, and those of the README with them.

One of a library that is not installed is skipped.
"""

import ast
import re
from pathlib import Path

import pytest

from veca_marl import list_tasks  # the package registers the ids
from veca_marl.config import compose
from veca_marl.sim.body.action import VoiceKind

ROOT = Path(__file__).resolve().parent.parent
PAGES = [ROOT / "docs" / "guides" / "other_libraries.md", ROOT / "README.md"]
SNIPPETS = [
    pytest.param(snippet, id=f"{page.stem}-{number}")
    for page in PAGES
    for number, snippet in enumerate(
        re.findall(r"^```python\n(.*?)^```", page.read_text(encoding="utf-8"), re.M | re.S)
    )
]


def imported(snippet):
    """Return the modules of other libraries that a snippet imports."""
    statements = ast.walk(ast.parse(snippet))
    names = [node.module for node in statements if isinstance(node, ast.ImportFrom)]
    statements = ast.walk(ast.parse(snippet))
    imports = [node for node in statements if isinstance(node, ast.Import)]
    names += [alias.name for node in imports for alias in node.names]
    return [name for name in names if not name.startswith("veca_marl")]


def test_each_page_has_snippets():
    assert {param.id.rsplit("-", 1)[0] for param in SNIPPETS} == {page.stem for page in PAGES}


@pytest.mark.parametrize("snippet", SNIPPETS)
def test_a_snippet_runs(snippet):
    for module in imported(snippet):
        pytest.importorskip(module, exc_type=ImportError)
    exec(compile(snippet, "snippet", "exec"), {})


def test_the_ids_that_need_another_layout_are_those_with_several_parts_or_agents():
    rows = re.findall(r"^\| (\w+(?:, \w+)+): (actions|several agents)", PAGES[0].read_text(), re.M)
    several = {"actions": set(), "several agents": set()}
    for name in (task for suite in ("veca", "babybench") for task in list_tasks(suite=suite)):
        game = compose([f"+task={name}"]).game
        if sum(team.size for team in game.teams) > 1:
            several["several agents"].add(name)
        elif getattr(game.body, "verbs", ()) or game.body.voice is VoiceKind.calls:
            several["actions"].add(name)
    assert {kind: set(names.split(", ")) for names, kind in rows} == several
