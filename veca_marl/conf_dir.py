"""The folder of the project's configuration files."""

from __future__ import annotations

from pathlib import Path

_PACKAGE = Path(__file__).parent


def conf_dir() -> Path:
    """Return the folder with `config.yaml` and the groups of choices.

    A wheel contains it as `veca_marl/conf`; in a checkout it is `conf` beside the package.

    Raises:
        FileNotFoundError: If the installation is incomplete.
    """
    candidates = (_PACKAGE / "conf", _PACKAGE.parent / "conf")
    for folder in candidates:
        if (folder / "config.yaml").is_file():
            return folder
    raise FileNotFoundError(
        f"no configuration files (config.yaml) in {' or '.join(map(str, candidates))}"
    )
