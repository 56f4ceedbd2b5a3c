"""The notebooks of examples/ run, and what is stored in them is what they print."""

import ast
import re

import nbformat
import pytest

import veca_marl
from tools.make_notebooks import executed, notebooks, printed

DECIMAL = re.compile(r"-?\d+\.\d*(e-?\d+)?|\b(nan|inf)\b")  # differ between processors


def words(text):
    """Return a text with spaces that do not depend on the length of numbers, decimals as ``#``."""
    return re.sub(r"\s+", " ", DECIMAL.sub("#", text)).strip()


@pytest.mark.parametrize("path", notebooks(), ids=lambda path: path.stem)
def test_a_notebook_has_outputs_without_messages_of_the_machine(path):
    notebook = nbformat.read(path, as_version=4)
    cells = [cell for cell in notebook.cells if cell.cell_type == "code"]
    assert all(cell.execution_count for cell in cells), "python -m tools.make_notebooks"
    assert not [one for cell in cells for one in cell.outputs if one.get("name") == "stderr"]
    assert any("<picture>" in text for text in printed(notebook))


@pytest.mark.slow
@pytest.mark.golden
@pytest.mark.parametrize("path", notebooks(), ids=lambda path: path.stem)
def test_a_notebook_prints_what_is_stored_in_it(path):
    stored = printed(nbformat.read(path, as_version=4))
    now = printed(executed(path))
    assert list(map(words, now)) == list(map(words, stored)), "python -m tools.make_notebooks"


def test_the_notebook_lists_every_task():
    (path,) = (path for path in notebooks() if path.stem == "first_light")
    listed = printed(nbformat.read(path, as_version=4))[0]
    assert ast.literal_eval(listed) == veca_marl.list_tasks()
