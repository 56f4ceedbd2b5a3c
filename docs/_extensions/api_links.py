"""Code that names an object of the package leads to its description; search ranks public names.

A guide writes `Task.solved` or `veca_marl.make` as code, which any reader of Markdown shows; in the
site it is a link as well. In the search, objects that are public (`veca_marl`, `veca_marl.extend`)
come before those of the inner modules.
"""

from __future__ import annotations

import builtins
import pkgutil
import re
from collections.abc import Iterator, Mapping
from functools import cache
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.domains.python import PythonDomain
from sphinx.util.nodes import make_refnode

from tools.docs_pages.api_page import public_names
from veca_marl.envs.core.task import TASKS

# `Name`, `Name.member`, `veca_marl.path.name`, with or without arguments
_CODE = re.compile(r"^(?P<path>[A-Za-z_]\w*(?:\.\w+)*)(?:\(.*\))?$", re.DOTALL)
_NAMES = ("reference/api", "api/")  # pages in which each code is a name
_WORDS = ("make", "train", "connect", "terms")  # elsewhere these are commands, or words


@cache
def _public() -> dict[str, str]:
    """Return where each public name is defined, `Task` to `veca_marl.envs.core.task.Task`."""
    return {name: f"{thing.__module__}.{thing.__qualname__}" for name, thing in public_names()}


class RankedPythonDomain(PythonDomain):
    """Python objects, of which the search lists the public ones first."""

    def find_obj(self, env: Any, module: Any, owner: Any, name: str, *rest: Any) -> Any:
        """See `PythonDomain`: types such as `object` are not attributes of the same name."""
        if hasattr(builtins, name):
            return []
        return super().find_obj(env, module, owner, name, *rest)

    def get_objects(self) -> Iterator[tuple[str, str, str, str, str, int]]:
        """See `Domain.get_objects`: objects and the priority of each."""
        public = set(_public().values())
        for name, shown, kind, page, anchor, priority in super().get_objects():
            if priority >= 0:  # others are not searched
                is_public = name in public or name.rpartition(".")[0] in public
                priority = _priority(kind, is_public)
            yield name, shown, kind, page, anchor, priority


def _priority(kind: str, is_public: bool) -> int:
    """Return the rank in the search: 0 is important, 1 the default, 2 unimportant."""
    if kind in ("module", "attribute"):
        return 1 if is_public or kind == "module" else 2
    return 0 if is_public else 2


def link_code(app: Sphinx, doctree: nodes.document, page: str) -> None:
    """Make references of the code in a page that names an object."""
    domain = app.env.domains["py"]
    classes = _only_classes(domain.objects)
    for literal in list(doctree.findall(nodes.literal)):
        if isinstance(literal.parent, (nodes.reference, nodes.title)):
            continue
        text = literal.astext()
        target = _target(text, domain.objects, classes)
        if target is None or (text in _WORDS and not page.startswith(_NAMES)):
            continue
        entry = domain.objects[target]
        if (entry.docname, entry.objtype) == (page, "module"):
            continue
        link = make_refnode(app.builder, page, entry.docname, entry.node_id, literal.copy(), target)
        link[0] += [child.deepcopy() for child in literal.children]
        literal.replace_self(link)


def _target(text: str, objects: Any, classes: Mapping[str, str]) -> str | None:
    """Return the full name of the object that code names; None if it names none."""
    match = _CODE.match(text)
    if match is None:
        return None
    path = match["path"]
    name, _, member = path.removeprefix("veca_marl.").removeprefix("extend.").partition(".")
    if name in _public():
        own = _member(name, member, objects) if member else None
        return own or _known(_public()[name], objects)
    if path.startswith("veca_marl."):
        return path if path in objects else _known(_full_name(path), objects)
    return None if member else classes.get(name)


def _only_classes(objects: Any) -> dict[str, str]:
    """Return the classes by their names where no other class has the name.

    Tasks are left out: they have pages, to which texts link.
    """
    named: dict[str, list[str]] = {}
    for path, entry in objects.items():
        if entry.objtype == "class":
            named.setdefault(path.rpartition(".")[2], []).append(path)
    return {
        name: paths[0] for name, paths in named.items() if len(paths) == 1 and name not in TASKS
    }


def _full_name(path: str) -> str:
    """Return where an object is defined that a package exports; empty if it is none."""
    try:
        thing = pkgutil.resolve_name(path)
    except (AttributeError, ImportError, ValueError):
        return ""
    return f"{getattr(thing, '__module__', '')}.{getattr(thing, '__qualname__', '')}"


def _known(target: str, objects: Any) -> str | None:
    return target if target in objects else None


def _member(name: str, member: str, objects: Any) -> str | None:
    """Return the full name of the member of a public class, where it or a base class defines it."""
    thing = dict(public_names())[name]
    for owner in getattr(thing, "__mro__", ()):
        target = f"{owner.__module__}.{owner.__qualname__}.{member}"
        if target in objects:
            return target
    return None


def setup(app: Sphinx) -> dict[str, Any]:
    """Replace the Python domain; link when all objects are known."""
    app.add_domain(RankedPythonDomain, override=True)
    app.connect("doctree-resolved", link_code)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
