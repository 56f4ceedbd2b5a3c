"""Where the checkout is, and what may lie beside it."""

from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
HELPERS = Path(__file__).parent
SHARED = ROOT.parent / "shared"
