"""All private parts of TorchRL and torch that the package uses are listed, and exist."""

import ast
import importlib
import inspect
import pkgutil

import pytest

import veca_marl
from veca_marl.private_parts import PRIVATE_PARTS

FOREIGN = ("torch", "torchrl", "tensordict")
DOCUMENTED = {"_step", "_reset", "_set_seed"}  # what TorchRL lets environments define


def is_private(name):
    return name.startswith("_") and not name.startswith("__") and name not in DOCUMENTED


def foreign(cls):
    return [base for base in cls.__mro__ if base.__module__.split(".")[0] in FOREIGN]


def overridden(cls):
    """Yield the private methods of a class that replace those of a base of another package."""
    for name, value in vars(cls).items():
        is_method = inspect.isfunction(value) or isinstance(value, property)
        if is_method and is_private(name) and any(name in vars(base) for base in foreign(cls)):
            yield name


def named(module):
    """Yield private names that are imported from, or read of, TorchRL, TensorDict and torch."""
    for node in ast.walk(ast.parse(inspect.getsource(module))):
        if isinstance(node, ast.ImportFrom) and (node.module or "").split(".")[0] in FOREIGN:
            yield from (alias.name for alias in node.names if is_private(alias.name))
        is_attribute = isinstance(node, ast.Attribute) and is_private(node.attr)
        if is_attribute and ast.unparse(node.value) in {"TensorDict", *FOREIGN}:
            yield node.attr


def used():
    """Return the names of all private parts in use, with the module of one use."""
    found = {}
    for info in pkgutil.walk_packages(veca_marl.__path__, "veca_marl."):
        if info.name.endswith("__main__"):
            continue
        module = importlib.import_module(info.name)
        for name in named(module):
            found[name] = info.name
        for cls in vars(module).values():
            if inspect.isclass(cls) and cls.__module__ == info.name:
                found |= dict.fromkeys(overridden(cls), info.name)
    return found


def test_no_private_part_is_used_that_is_not_listed():
    listed = {part.rsplit(".", 1)[1] for part in PRIVATE_PARTS}
    assert {name: user for name, user in used().items() if name not in listed} == {}


@pytest.mark.parametrize("part", PRIVATE_PARTS)
def test_a_listed_part_exists(part):
    names = part.split(".")
    owner, rest = None, []
    for count in range(len(names) - 1, 0, -1):
        try:
            owner, rest = importlib.import_module(".".join(names[:count])), names[count:]
        except ModuleNotFoundError:
            continue
        break
    for name in rest:
        assert hasattr(owner, name)
        owner = getattr(owner, name)
