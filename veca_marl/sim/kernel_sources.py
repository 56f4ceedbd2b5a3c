"""The sources that a compiled kernel may contain, and a digest of them.

A kernel is compiled together with what it calls and with the constants that it reads, which may be
defined in the modules that its own module imports, in those that these import, and so on. A cached
kernel is valid as long as none of these files has changed; a change of any other file leaves it
valid.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator
from pathlib import Path

import numba

_DIGEST_CHARACTERS = 16
_FROM = re.compile(r"^[ \t]*from[ \t]+([\w.]+)[ \t]+import[ \t]+(\([^)]*\)|[^\n]*)", re.MULTILINE)
_IMPORT = re.compile(r"^[ \t]*import[ \t]+([\w., \t]+)", re.MULTILINE)
_NAME = re.compile(r"(\w+)(?:\s+as\s+\w+)?")


class KernelSources:
    """The Python files of a package.

    Each file is read once.

    Args:
        package: The folder of the package. Its modules import each other by absolute names.
    """

    def __init__(self, package: Path) -> None:
        self._package = package
        self._contents: dict[Path, bytes] = {}
        self._imports: dict[Path, set[Path]] = {}
        self._digests: dict[Path, str] = {}

    def contain(self, file: Path) -> bool:
        """Return whether a file belongs to the package."""
        return file.is_relative_to(self._package)

    def module(self, file: Path) -> str:
        """Return the name of the module of a file of the package."""
        return ".".join(file.relative_to(self._package.parent).with_suffix("").parts)

    def digest(self, file: Path) -> str:
        """Return a digest of a file of the package and of all that it imports from there.

        The version of numba is a part of it.
        """
        if file not in self._digests:
            self._digests[file] = self._digest_of(self.closure(file))
        return self._digests[file]

    def digest_of_all(self) -> str:
        """Return a digest of all files of the package and the version of numba."""
        if self._package not in self._digests:
            self._digests[self._package] = self._digest_of(set(self._package.rglob("*.py")))
        return self._digests[self._package]

    def imports(self, file: Path) -> set[Path]:
        """Return the files of the package that a file of it imports."""
        if file not in self._imports:
            names = set(_imported_names(self._read(file).decode()))
            self._imports[file] = set(filter(None, map(self._file, names)))
        return self._imports[file]

    def closure(self, file: Path) -> set[Path]:
        """Return a file, what it imports, what these import, and so on."""
        found, open_files = {file}, [file]
        while open_files:
            new = self.imports(open_files.pop()) - found
            found |= new
            open_files += new
        return found

    def _digest_of(self, files: set[Path]) -> str:
        digest = hashlib.sha256(numba.__version__.encode())
        for path in sorted(files):
            content = self._read(path)
            digest.update(f"{path.relative_to(self._package).as_posix()} {len(content)}\n".encode())
            digest.update(content)
        return digest.hexdigest()[:_DIGEST_CHARACTERS]

    def _read(self, file: Path) -> bytes:
        if file not in self._contents:
            self._contents[file] = file.read_bytes()
        return self._contents[file]

    def _file(self, module: str) -> Path | None:
        """Return the file of a module of the package, None for another name."""
        first, *others = module.split(".")
        if first != self._package.name:
            return None
        path = self._package.joinpath(*others)
        candidates = (path.with_suffix(".py") if others else path, path / "__init__.py")
        return next((file for file in candidates if file.is_file()), None)


def _imported_names(text: str) -> Iterator[str]:
    """Yield the modules that a text imports, and the names in them, which may be modules too."""
    for module, names in _FROM.findall(text):
        yield module
        yield from (f"{module}.{name}" for name in _NAME.findall(names))
    for modules in _IMPORT.findall(text):
        yield from (module.split()[0] for module in modules.split(",") if module.strip())
