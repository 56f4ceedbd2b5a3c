"""The snippets of docs/guides/other_libraries.md run, and those of the README with them."""

import re
from pathlib import Path

import pytest

import veca_marl  # noqa: F401  registers the ids

ROOT = Path(__file__).resolve().parent.parent
PAGES = [ROOT / "docs" / "guides" / "other_libraries.md", ROOT / "README.md"]
SNIPPETS = [
    pytest.param(snippet, id=f"{page.stem}-{number}")
    for page in PAGES
    for number, snippet in enumerate(
        re.findall(r"^```python\n(.*?)^```", page.read_text(encoding="utf-8"), re.M | re.S)
    )
]


def test_each_page_has_snippets():
    assert {param.id.rsplit("-", 1)[0] for param in SNIPPETS} == {page.stem for page in PAGES}


@pytest.mark.parametrize("snippet", SNIPPETS)
def test_a_snippet_runs(snippet):
    exec(compile(snippet, "snippet", "exec"), {})
