"""`veca_marl.extend` has everything that guides and plug-ins import, without loading torch."""

import ast
import subprocess
import sys
from pathlib import Path

import pytest

from veca_marl import extend


def test_every_name_leads_to_an_object_and_has_its_type():
    tree = ast.parse(Path(extend.__file__).read_text())
    typed = next(node for node in tree.body if isinstance(node, ast.If))
    homes = {a.asname: i.module for i in typed.body for a in i.names}
    assert homes == extend._HOMES
    assert sorted(homes) == extend.__all__ == dir(extend)
    assert all(getattr(extend, name) is not None for name in extend.__all__)


def test_an_unknown_name_lists_the_choices():
    with pytest.raises(ImportError):
        from veca_marl.extend import Tusk  # noqa: F401
    with pytest.raises(AttributeError, match="Task"):
        extend.Tusk  # noqa: B018


@pytest.mark.slow
def test_a_task_needs_no_learning_library():
    code = (
        "import sys\nfrom veca_marl.extend import Task, register_task, PropCfg\n"
        "assert 'torch' not in sys.modules"
    )
    subprocess.run([sys.executable, "-c", code], check=True)


def test_guides_and_the_example_import_nothing_of_the_package_that_is_in_it_from_elsewhere():
    root = Path(__file__).parent.parent
    pages = [*(root / "docs" / "guides").glob("*.md"), *(root / "examples").rglob("*.py")]
    for page in pages:
        for line in page.read_text(encoding="utf-8").splitlines():
            if line.startswith("from veca_marl.") and not line.startswith("from veca_marl.extend"):
                names = {name.strip() for name in line.partition(" import ")[2].split(",")}
                assert not names & set(extend.__all__), f"{page.name}: {line}"
