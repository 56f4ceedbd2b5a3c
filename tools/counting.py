"""How large the modules of a package are, how they import each other, and how they are named.

Everything is a function of the texts of the modules, so that a commit is counted without being
checked out. `count.py` prints the result.
"""

from __future__ import annotations

import ast
import io
import math
import tokenize
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from pathlib import PurePosixPath
from statistics import fmean

SMALL_LINES = 25
"""A module with fewer lines of code is small."""
INIT = "__init__.py"

_NO_CODE = (
    tokenize.COMMENT,
    tokenize.NL,
    tokenize.NEWLINE,
    tokenize.INDENT,
    tokenize.DEDENT,
    tokenize.ENDMARKER,
)
_FUNCTIONS = (ast.FunctionDef, ast.AsyncFunctionDef)


@dataclass(frozen=True)
class Module:
    """What is counted in one module.

    Attributes:
        path: Its path with the package as first part, such as ``veca_marl/envs/core/game.py``.
        lines: Lines of code: without blank lines, comments and texts that are statements
            (docstrings, also of attributes).
        import_lines: Those of them that belong to import statements.
        own_import_lines: Those of them that import from the same package.
        own: Dotted names of the modules of the same package that it imports, each once.
        functions: Lines of code of each function and method, with the `def` and with the functions
            inside.
    """

    path: PurePosixPath
    lines: int
    import_lines: int
    own_import_lines: int
    own: frozenset[str]
    functions: tuple[int, ...]

    @property
    def is_init(self) -> bool:
        """Whether it is the ``__init__.py`` of a folder."""
        return self.path.name == INIT


@dataclass(frozen=True)
class Size:
    """The size of a part of the package."""

    modules: int
    lines: int


def read_modules(sources: Mapping[str, str]) -> list[Module]:
    """Count every module of a package.

    Args:
        sources: Text of each module by its path, see `Module.path`.

    Returns:
        The modules in the order of their paths.

    Raises:
        ValueError: If there is no module.
        SyntaxError: If a text is no Python.
    """
    if not sources:
        raise ValueError("the package has no modules")
    names = frozenset(dotted(PurePosixPath(path)) for path in sources)
    return [_read(PurePosixPath(path), text, names) for path, text in sorted(sources.items())]


def dotted(path: PurePosixPath) -> str:
    """Return the name that a module is imported by; that of an ``__init__.py`` is its folder's."""
    parts = path.parts[:-1] if path.name == INIT else path.with_suffix("").parts
    return ".".join(parts)


def _read(path: PurePosixPath, text: str, names: frozenset[str]) -> Module:
    tree = ast.parse(text)
    lines = code_lines(text, tree)
    imports = [node for node in ast.walk(tree) if isinstance(node, (ast.Import, ast.ImportFrom))]
    own = {node: frozenset(_own_targets(node, path, names)) for node in imports}
    return Module(
        path=path,
        lines=len(lines),
        import_lines=len(lines & _span(imports)),
        own_import_lines=len(lines & _span(node for node in imports if own[node])),
        own=frozenset().union(*own.values()),
        functions=tuple(
            len(lines & _span([node])) for node in ast.walk(tree) if isinstance(node, _FUNCTIONS)
        ),
    )


def code_lines(text: str, tree: ast.AST) -> set[int]:
    """Return the numbers of the lines of code, see `Module.lines`."""
    tokens = tokenize.generate_tokens(io.StringIO(text).readline)
    spans = (range(t.start[0], t.end[0] + 1) for t in tokens if t.type not in _NO_CODE)
    texts = [node for node in ast.walk(tree) if _is_text(node)]
    return {line for span in spans for line in span} - _span(texts)


def _is_text(node: ast.AST) -> bool:
    return (
        isinstance(node, ast.Expr)
        and isinstance(node.value, ast.Constant)
        and isinstance(node.value.value, str)
    )


def _span(nodes: Iterable[ast.AST]) -> set[int]:
    """Return the numbers of the lines of some nodes, without decorators."""
    found: set[int] = set()
    for node in nodes:
        if isinstance(node, (ast.stmt, ast.expr)):
            found.update(range(node.lineno, (node.end_lineno or node.lineno) + 1))
    return found


def _own_targets(
    node: ast.Import | ast.ImportFrom, path: PurePosixPath, names: frozenset[str]
) -> Iterator[str]:
    """Return the modules of the package that a statement imports, or imports something from."""
    if isinstance(node, ast.Import):
        yield from (alias.name for alias in node.names if alias.name in names)
        return
    source = _source(node, path)
    for alias in node.names:
        inner = f"{source}.{alias.name}"
        if inner in names:
            yield inner
        elif source in names:
            yield source


def _source(node: ast.ImportFrom, path: PurePosixPath) -> str:
    """Return the absolute name of what ``from ... import`` names; dots count from the module."""
    if not node.level:
        return node.module or ""
    folder = path.parts[: len(path.parts) - node.level]
    return ".".join([*folder, *([node.module] if node.module else [])])


def folders(modules: Iterable[Module]) -> int:
    """Return the number of folders that contain modules themselves."""
    return len({module.path.parent for module in modules})


def size(modules: Iterable[Module]) -> Size:
    """Return the size of some modules."""
    counted = list(modules)
    return Size(len(counted), sum(module.lines for module in counted))


def subpackages(modules: Iterable[Module], levels: int = 2) -> dict[str, Size]:
    """Return the size of each subpackage down to a depth, with everything inside it.

    Args:
        modules: The modules of the package.
        levels: Depth below the package.

    Returns:
        Size by dotted name, in the order of the names.
    """
    groups: dict[str, list[Module]] = {}
    for module in modules:
        parents = module.path.parts[:-1]
        for depth in range(2, min(len(parents), levels + 1) + 1):
            groups.setdefault(".".join(parents[:depth]), []).append(module)
    return {name: size(group) for name, group in sorted(groups.items())}


def import_fraction(modules: Iterable[Module]) -> float:
    """Return the fraction of the lines of code that belong to import statements."""
    counted = list(modules)
    return _ratio(sum(m.import_lines for m in counted), sum(m.lines for m in counted))


def own_imports(modules: Iterable[Module]) -> float:
    """Return how many modules of the package a module imports, mean over all modules."""
    return fmean(len(module.own) for module in modules)


def own_imports_of_importers(modules: Iterable[Module]) -> float:
    """Return the same mean over the modules that import at least one; 0 if there is none."""
    counts = [len(module.own) for module in modules if module.own]
    return fmean(counts) if counts else 0.0


def own_import_lines(modules: Iterable[Module]) -> float:
    """Return how many lines of a module import from the package, mean over all modules."""
    return fmean(module.own_import_lines for module in modules)


def small(modules: Iterable[Module]) -> tuple[int, float]:
    """Return number and fraction of small modules, both without the ``__init__.py``."""
    plain = [module for module in modules if not module.is_init]
    found = sum(module.lines < SMALL_LINES for module in plain)
    return found, _ratio(found, len(plain))


def namesakes(modules: Iterable[Module]) -> int:
    """Return how many modules share the name of their file with another, without ``__init__.py``.

    A name that three modules have counts three times.
    """
    names = Counter(module.path.name for module in modules if not module.is_init)
    return sum(count for count in names.values() if count > 1)


def function_lines(modules: Iterable[Module]) -> list[int]:
    """Return the lines of code of every function, in ascending order."""
    return sorted(length for module in modules for length in module.functions)


def percentile(ascending: Sequence[int], fraction: Fraction) -> int:
    """Return the least value that at least this fraction of the values does not exceed.

    Args:
        ascending: The values in ascending order.
        fraction: In (0, 1], exact, so that no rounding moves the rank.

    Raises:
        ValueError: If there are no values or the fraction is none.
    """
    if not ascending or not 0 < fraction <= 1:
        raise ValueError(f"no percentile {fraction} of {len(ascending)} values; fraction in (0, 1]")
    return ascending[math.ceil(len(ascending) * fraction) - 1]


def largest(modules: Iterable[Module], count: int) -> list[Module]:
    """Return the modules with the most lines of code, the largest first."""
    return sorted(modules, key=lambda module: (-module.lines, module.path))[:count]


def _ratio(part: int, whole: int) -> float:
    return part / whole if whole else 0.0
