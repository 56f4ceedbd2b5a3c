"""Metadata of a release: the addresses of the project, and a README that a package index can show.

The README links to files of the repository, which an index does not have. Where the environment
names the repository (``VECA_MARL_REPOSITORY=https://github.com/OWNER/NAME``, set by the workflow
of a release), its links lead to the files of the release there, and its pictures are loaded from
there. Elsewhere the README stays as it is, and there are no addresses.
"""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any

from hatchling.metadata.plugin.interface import MetadataHookInterface

REPOSITORY = "VECA_MARL_REPOSITORY"
_LINK = re.compile(
    r"(?P<picture>!?)\[(?P<text>(?:[^\[\]]|\[[^\]]*\])*)\]\((?P<path>(?!https?:|#)[^)\s]+)\)"
)


def with_absolute_links(readme: str, repository: str, version: str) -> str:
    """Return a README whose relative links and pictures lead to a release of a repository.

    Args:
        readme: Markdown.
        repository: Its address, without a slash at the end.
        version: The release; its tag has a ``v`` before it.
    """

    def absolute(link: re.Match[str]) -> str:
        kind = "raw" if link["picture"] else "blob"
        target = f"{repository}/{kind}/v{version}/{link['path']}"
        return f"{link['picture']}[{link['text']}]({target})"

    return _LINK.sub(absolute, readme)


def addresses(repository: str, version: str) -> dict[str, str]:
    """Return the links that a package index lists beside the description."""
    tag = f"{repository}/blob/v{version}"
    return {
        "Homepage": repository,
        "Source": repository,
        "Documentation": f"{tag}/docs/index.md",
        "Changelog": f"{tag}/CHANGELOG.md",
        "Issues": f"{repository}/issues",
    }


class ReleaseMetadata(MetadataHookInterface):
    """Fills `readme` and `urls` of ``pyproject.toml``."""

    def update(self, metadata: dict[str, Any]) -> None:
        """See `MetadataHookInterface.update`."""
        readme = (Path(self.root) / "README.md").read_text(encoding="utf-8")
        version = (Path(self.root) / "veca_marl" / "version.py").read_text(encoding="utf-8")
        number = re.search(r'__version__ = "(.+)"', version)
        if number is None:
            raise ValueError("veca_marl/version.py has no __version__")
        repository = os.environ.get(REPOSITORY, "").rstrip("/")
        if repository:
            readme = with_absolute_links(readme, repository, number[1])
            metadata["urls"] = addresses(repository, number[1])
        metadata["readme"] = {"content-type": "text/markdown", "text": readme}
