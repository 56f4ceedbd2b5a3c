"""The gallery and its clips."""

from pathlib import Path

import av
import pytest

from tools.docs_pages.gallery_page import gallery_page
from tools.docs_pages.task_pages import built_in_tasks
from tools.make_films import (
    ALL_BYTES,
    CLIPS,
    DOCS,
    LARGEST_BYTES,
    LONGEST_S,
    SHORTEST_S,
)

FILMS = sorted((DOCS / "_static" / "films").glob("*.webm"))


def test_the_page_is_that_of_this_commit():
    assert (DOCS / "tasks" / "gallery.md").read_text(encoding="utf-8") == gallery_page()


def test_every_clip_belongs_to_a_task_and_all_are_small():
    assert {path.stem for path in FILMS} <= set(built_in_tasks())
    assert set(CLIPS) <= set(built_in_tasks())
    sizes = [path.stat().st_size for path in FILMS]
    assert max(sizes) <= LARGEST_BYTES
    assert sum(sizes) <= ALL_BYTES
    assert (DOCS / "images" / "film.webp").stat().st_size <= LARGEST_BYTES


@pytest.mark.parametrize("path", FILMS, ids=[path.stem for path in FILMS])
def test_a_clip_lasts_6_to_10_seconds(path: Path):
    with av.open(str(path)) as container:
        (stream,) = container.streams
        assert container.duration is not None
        assert SHORTEST_S - 0.1 <= container.duration / av.time_base <= LONGEST_S + 0.1
        assert (stream.width, stream.height) == (640, 360)
