"""An episode as one HTML file without references to others, and read back from it.

The file holds a description in JSON, one block of bytes with all arrays, pictures and sounds
(`Packer`), and the viewer: its modules and three.js, compressed. A browser needs neither a server
nor a network.
"""

from __future__ import annotations

import base64
import html
import json
import re
import zlib
from importlib.resources import files
from pathlib import Path
from typing import Any

from veca_marl.algos.files import write_atomically
from veca_marl.runs.episode_page.description import FORMAT, describe, restore
from veca_marl.runs.episode_page.episode import Episode
from veca_marl.runs.episode_page.packing import Packer
from veca_marl.stored_files import MEGABYTE, StoredFileError, read_text

_LARGEST = 500 * MEGABYTE
_WEB = "web"
_MODULES = ("data", "world", "camera", "panels", "timeline", "clock", "main")
_THREE = "three.module.min.js"
_END = "</html>\n"


def write_page(path: Path, episode: Episode) -> None:
    """Write an episode as a page; the file is complete, or what it was before.

    Args:
        path: The file; missing folders are created.
        episode: The episode.

    Raises:
        WriteError: If it cannot be written.
    """
    write_atomically(path, page_of(episode))


def page_of(episode: Episode) -> str:
    """Return the page of an episode."""
    packer = Packer()
    description = describe(episode, packer)
    block = packer.block
    description |= {"arrays": packer.entries, "bytes": len(block), "crc": zlib.crc32(block)}
    parts = {
        "title": html.escape(f"{episode.title} - veca_marl"),
        "licence": _web_text("LICENSE.three"),
        "style": _web_text("viewer.css"),
        "description": _json(description),
        "data": base64.b64encode(block).decode(),
        "modules": "\n".join(_module(name) for name in ("three", *_MODULES)),
        "boot": _web_text("boot.js"),
    }
    # in one pass: what is filled in is not searched again
    return re.sub(r"\{\{(\w+)\}\}", lambda found: parts[found[1]], _web_text("template.html"))


def _web_text(name: str) -> str:
    return (files(__package__) / _WEB / name).read_text(encoding="utf-8")


def _module(name: str) -> str:
    text = _web_text(_THREE if name == "three" else f"{name}.js")
    packed = base64.b64encode(zlib.compress(text.encode(), 9)).decode()
    return f'<script type="text/plain" data-module="{name}">{packed}</script>'


def _json(content: Any) -> str:
    """Return JSON that cannot end the element it is in, whatever the names of tasks are."""
    return json.dumps(content, separators=(",", ":"), allow_nan=False).replace("<", "\\u003c")


def read_page(path: Path) -> Episode:
    """Return the episode of a page, as exact as it is stored there; sounds are left out.

    Raises:
        StoredFileError: If it is no such page, was altered or cut off, or is of another format.
    """
    text = read_text(path, _LARGEST)
    try:
        description, block = _contents(text)
        return restore(description, block)
    except (LookupError, TypeError, ValueError) as error:
        raise StoredFileError(path, error) from error


def _contents(text: str) -> tuple[dict[str, Any], bytes]:
    found = re.search(r'<script type="application/json" id="episode">(.*?)</script>', text, re.S)
    data = re.search(r'<script type="text/plain" id="data">(.*?)</script>', text, re.S)
    if found is None or data is None or not text.endswith(_END):
        raise ValueError("it holds no whole episode")
    description = json.loads(found[1])
    if not isinstance(description, dict) or description.get("format") != FORMAT:
        raise ValueError(f"its format is not {FORMAT}")
    block = base64.b64decode(data[1], validate=True)
    if len(block) != description["bytes"] or zlib.crc32(block) != description["crc"]:
        raise ValueError("its data were altered")
    return description, block
