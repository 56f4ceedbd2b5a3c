"""Every package that is imported is declared, also one that another dependency installs."""

import ast
import re
import sys
import tomllib
from importlib.metadata import packages_distributions

from paths import ROOT

OWN = {"veca_marl", "hydra_plugins", "tools"}


def imported():
    """Return the top-level names of all imports."""
    names = set()
    for folder in OWN:
        for path in (ROOT / folder).rglob("*.py"):
            for node in ast.walk(ast.parse(path.read_text())):
                if isinstance(node, ast.Import):
                    names |= {alias.name.partition(".")[0] for alias in node.names}
                elif isinstance(node, ast.ImportFrom) and not node.level:
                    names.add(node.module.partition(".")[0])
    return names - OWN - sys.stdlib_module_names


def declared():
    """Return the distributions of `pyproject.toml`, of the extras too, in lower case."""
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]
    extras = [text for texts in project["optional-dependencies"].values() for text in texts]
    return {re.match(r"[\w-]+", text)[0].lower() for text in project["dependencies"] + extras}


def test_every_imported_package_is_declared():
    distributions = packages_distributions()
    undeclared = {
        name
        for name in imported()
        if not {d.lower() for d in distributions.get(name, [name])} & declared()
    }
    assert undeclared == set()
