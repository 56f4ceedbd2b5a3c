"""The checkout that a tool measures is the one it lies in."""

from __future__ import annotations

from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


def check_imported(file: str | None) -> None:
    """Check that a package was imported from this checkout, not from another that is installed.

    Otherwise two checkouts would be compared of which only one was measured.

    Args:
        file: `__file__` of the package.

    Raises:
        SystemExit: If it lies elsewhere; status 2.
    """
    if file is None or not Path(file).resolve().is_relative_to(ROOT):
        print(f"error: veca_marl was imported from {file}; set PYTHONPATH={ROOT}")
        raise SystemExit(2)
