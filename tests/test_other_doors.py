"""The snippets of docs/guides/other_libraries.md run, and those of the README with them."""

import re
from pathlib import Path

import gymnasium
import pytest

import veca_marl.envs.adapters.gymnasium_ids as ids

ROOT = Path(__file__).resolve().parent.parent
PAGES = [ROOT / "docs" / "guides" / "other_libraries.md", ROOT / "README.md"]
SNIPPETS = [
    pytest.param(snippet, id=f"{page.stem}-{number}")
    for page in PAGES
    for number, snippet in enumerate(
        re.findall(r"^```python\n(.*?)^```", page.read_text(encoding="utf-8"), re.M | re.S)
    )
]


def test_there_are_snippets():
    assert len(SNIPPETS) >= 4


@pytest.mark.parametrize("snippet", SNIPPETS)
def test_a_snippet_runs(snippet):
    ids.register_ids()  # as `import veca_marl` after `import gymnasium` does, in a fresh process
    exec(compile(snippet, "snippet", "exec"), {})


def test_the_id_with_its_module_needs_no_import():
    name = re.search(r'gymnasium\.make\("(veca_marl\.envs\S+)"\)', PAGES[0].read_text())[1]
    gymnasium.make(name).close()
