"""Run the notebooks of ``examples/`` and store what they print and draw.

``python -m tools.make_notebooks`` runs all, with names as arguments these only. The tests run them
and compare what is printed. Sounds are left out of what is stored, and pictures made small.
"""

from __future__ import annotations

import argparse
import base64
import io
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import nbformat
from nbclient import NotebookClient
from PIL import Image

EXAMPLES = Path(__file__).resolve().parent.parent / "examples"
_KEPT = ("text/plain", "image/png")
_TIMEOUT_S = 900
_WIDTH_PX, _COLOURS = 720, 48


def notebooks() -> list[Path]:
    """Return the notebooks in the order of their names."""
    return sorted(EXAMPLES.glob("*.ipynb"))


def executed(path: Path) -> Any:
    """Return a notebook after all its cells have run, from the beginning.

    Raises:
        nbclient.exceptions.CellExecutionError: If a cell raises an error.
    """
    notebook = nbformat.read(path, as_version=4)
    resources = {"metadata": {"path": str(path.parent)}}
    NotebookClient(
        notebook, timeout=_TIMEOUT_S, kernel_name="python3", resources=resources
    ).execute()
    return notebook


def printed(notebook: Any) -> list[str]:
    """Return what each cell with code prints, in one text; pictures as ``<picture>``."""
    cells = [cell for cell in notebook.cells if cell.cell_type == "code"]
    return ["".join(_texts(cell.outputs)) for cell in cells]


def _texts(outputs: list[Any]) -> Iterator[str]:
    for output in outputs:
        if output.output_type == "stream" and output.name == "stdout":
            yield output.text
        elif "image/png" in output.get("data", {}):
            yield "<picture>\n"
        elif "text/plain" in output.get("data", {}):
            yield output.data["text/plain"] + "\n"


def _small(kind: str, content: str) -> str:
    """Return a picture with few pixels and colours; text as it is."""
    if kind != "image/png":
        return content
    picture = Image.open(io.BytesIO(base64.b64decode(content))).convert("RGB")
    picture.thumbnail((_WIDTH_PX, _WIDTH_PX))
    file = io.BytesIO()
    picture.quantize(_COLOURS).save(file, "PNG", optimize=True)
    return base64.b64encode(file.getvalue()).decode()


def stripped(notebook: Any) -> Any:
    """Return a notebook without messages of the machine, sounds and times."""
    for cell in notebook.cells:
        cell.metadata = {}
        if cell.cell_type == "code":
            cell.outputs = [one for one in cell.outputs if one.get("name") != "stderr"]
            for output in cell.outputs:
                if "data" in output:
                    output.data = {k: _small(k, output.data[k]) for k in _KEPT if k in output.data}
    notebook.metadata.language_info = {"name": "python"}
    return notebook


def main() -> None:
    """Run notebooks and write them with their outputs."""
    parser = argparse.ArgumentParser(description=__doc__)
    names = [path.stem for path in notebooks()]
    parser.add_argument("names", nargs="*", choices=[*names, []], help="notebooks; all without one")
    for name in parser.parse_args().names or names:
        path = EXAMPLES / f"{name}.ipynb"
        nbformat.write(stripped(executed(path)), path)


if __name__ == "__main__":
    main()
