"""The task pages say what the docstrings say."""

import importlib.util
from pathlib import Path

import pytest

from veca_marl.api import list_tasks
from veca_marl.envs.task import find_task

ROOT = Path(__file__).resolve().parent.parent


def load_script():
    spec = importlib.util.spec_from_file_location("make_docs", ROOT / "scripts" / "make_docs.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


@pytest.mark.parametrize("name", list_tasks())
def test_the_page_of_a_task_is_that_of_its_docstring(name):
    page = (ROOT / "docs" / "tasks" / f"{name}.md").read_text(encoding="utf-8")
    assert page == load_script().task_page(find_task(name)), "run make docs"
