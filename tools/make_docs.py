"""Write the generated pages and pictures of ``docs/``: tasks and the reference pages.

Run it with ``make pages``; the results are committed. ``--no-pictures`` writes the pages alone.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable
from pathlib import Path

from tools.docs_pages.action_page import action_page
from tools.docs_pages.api_page import api_page
from tools.docs_pages.body_tables import body_page
from tools.docs_pages.config_page import config_page
from tools.docs_pages.observation_page import observation_page
from tools.docs_pages.pictures import write_pictures
from tools.docs_pages.playground_page import playground_page, write_playground_pictures
from tools.docs_pages.task_pages import overview_page, write_task_pages

DOCS = Path(__file__).resolve().parent.parent / "docs"
PAGES: dict[str, Callable[[], str]] = {
    "reference/actions.md": action_page,
    "reference/api.md": api_page,
    "reference/configuration.md": config_page,
    "reference/observations.md": observation_page,
    "reference/playgrounds.md": playground_page,
    "reference/tasks.md": overview_page,
}


def main() -> None:
    """Write all pages, and the pictures unless told otherwise."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--no-pictures", action="store_true", help="leave the pictures as they are")
    pictures = not parser.parse_args().no_pictures
    write_task_pages(DOCS / "tasks")
    for name, page in PAGES.items():
        (DOCS / name).write_text(page(), encoding="utf-8")
    body = DOCS / "reference" / "body.md"
    body.write_text(body_page(body.read_text(encoding="utf-8")), encoding="utf-8")
    if pictures:
        write_pictures(DOCS / "images")
        write_playground_pictures(DOCS / "images" / "playgrounds")


if __name__ == "__main__":
    main()
