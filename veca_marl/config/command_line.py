"""The command line of commands that are not Hydra applications, in the same grammar.

A command has options of its own (a dataclass such as `BenchOptions`); every other override belongs
to the configuration. ``-m`` runs the command once for each combination of the values that
overrides list: ``-m senses/audio=hrtf,mono``.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, fields
from itertools import product
from pathlib import Path
from typing import Any, Generic, TypeVar, cast

from hydra.core.override_parser.types import Glob, Override
from omegaconf import DictConfig, OmegaConf
from omegaconf.errors import OmegaConfBaseException

from veca_marl.config.errors import ConfigError, one_line
from veca_marl.config.overrides import parse
from veca_marl.config.root import Config
from veca_marl.override_text import normalised
from veca_marl.processes.cores import CoresError
from veca_marl.registry import unknown
from veca_marl.version import __version__

Options = TypeVar("Options")

_MULTIRUN = ("-m", "--multirun")
HELP = ("-h", "--help")
VERSION = "--version"
_STATUS_INTERRUPTED = 130


def print_version() -> None:
    """Print the version of this package, and not that of Hydra."""
    sys.stdout.write(f"veca_marl {__version__}\n")


@dataclass(frozen=True)
class CommandLine(Generic[Options]):
    """Splits the words of a command line into the options of the command and other overrides.

    Attributes:
        command: Name of the command, such as ``evaluate``.
        options: Dataclass of its options.
        description: What the command does; printed by ``--help``.
        errors: Errors, beside `ConfigError`, that end in one line.
        outputs: Keys of the options that name what a run of the command writes.
        places: Keys that decide where it writes if no output is named: combinations have to differ
            in one of them. None if it writes nothing then.
        keeps_sweep: Whether the command is called once, with the overrides that list values as they
            are, instead of once for each combination.
        root: Dataclass of the configuration that other overrides change.
    """

    command: str
    options: type[Options]
    description: str
    errors: tuple[type[Exception], ...] = ()
    outputs: tuple[str, ...] = ()
    places: tuple[str, ...] | None = None
    keeps_sweep: Callable[[Sequence[str]], bool] = lambda _: False
    root: type[Any] = Config

    def run(
        self, call: Callable[[Options, list[str]], None], words: Sequence[str] | None = None
    ) -> int:
        """Call the command for each combination of values; return the exit status.

        Args:
            call: Takes the options and the other overrides.
            words: The command line without the program; None is that of the process.

        Returns:
            0, or 2 after an error of the configuration, which is printed as one line.
        """
        words = list(sys.argv[1:] if words is None else words)
        if any(word in HELP for word in words):
            sys.stdout.write(self.help())
            return 0
        if VERSION in words:
            print_version()
            return 0
        expected: tuple[type[Exception], ...] = (ConfigError, CoresError, *self.errors)
        try:
            for options, overrides in self.jobs(words):
                call(options, overrides)
        except expected as error:
            sys.stderr.write(f"error: {one_line(error)}\n")
            return 2
        except KeyboardInterrupt:
            return _STATUS_INTERRUPTED
        return 0

    def jobs(self, words: Sequence[str]) -> Iterator[tuple[Options, list[str]]]:
        """Return the options and the other overrides of each run of the command.

        Raises:
            ConfigError: If an override does not follow the grammar, an option is unknown, or
                several runs would write the same file.
        """
        texts = [word for word in words if word not in _MULTIRUN]
        flags = [text for text in texts if text.startswith("-")]
        if flags:
            raise ConfigError(
                f"unknown flag {flags[0]!r}; choices: --help, --version, --multirun, KEY=VALUE"
            )
        others = [text for text in texts if _root(text) not in self._names]
        if self.keeps_sweep(others):
            combinations = [normalised(texts)]
        else:
            combinations = _combinations(parse(normalised(texts)), len(texts) < len(words))
        self._check_outputs(combinations)
        for combination in combinations:
            own = [text for text in combination if _root(text) in self._names]
            others = [text for text in combination if text not in own]
            self._check_roots(others)
            yield self._read(own), others

    def _check_outputs(self, combinations: Sequence[Sequence[str]]) -> None:
        """Raise `ConfigError` if a run would overwrite what another one has written."""
        named = [
            text
            for combination in combinations
            for text in combination
            if text.partition("=")[0] in self.outputs
        ]
        twice = sorted({text for text in named if named.count(text) > 1})
        if twice:
            raise ConfigError(
                f"{twice[0]} would be written by {named.count(twice[0])} combinations of values; "
                f"give each its own: {twice[0].partition('=')[0]}=A,B,..., or start the command "
                "once for each"
            )
        if self.places is None:
            return
        chosen = [
            tuple(sorted(text for text in combination if _key(text) in self.places))
            for combination in combinations
        ]
        if len(set(chosen)) < len(chosen):
            raise ConfigError(
                f"several combinations of values would write to one folder; let them differ in "
                f"{' or '.join(self.places)}, or start the command once for each"
            )

    @property
    def _names(self) -> list[str]:
        return [field.name for field in fields(cast(Any, self.options))]

    def _check_roots(self, overrides: list[str]) -> None:
        choices = sorted({*self._names, *(field.name for field in fields(self.root))})
        for text in overrides:
            root = _root(text)
            if text[0] not in "+~" and "/" not in root and root not in choices:
                raise ConfigError(unknown("key", root, choices))

    def _read(self, own: list[str]) -> Options:
        node: DictConfig = OmegaConf.structured(self.options)
        try:
            for override in parse(own):
                OmegaConf.update(node, override.key_or_group, override.value())
            missing = sorted(map(str, OmegaConf.missing_keys(node)))
            if missing:
                raise ConfigError(f"{self.command} needs {missing[0]}=VALUE")
            return cast(Options, OmegaConf.to_object(node))
        except (OmegaConfBaseException, ValueError) as error:
            raise ConfigError(one_line(error)) from error

    def help(self) -> str:
        """Return the description and the options with their defaults."""
        defaults = OmegaConf.to_yaml(OmegaConf.structured(self.options))
        others = ", ".join(field.name for field in fields(self.root))
        return (
            f"{self.description.strip()}\n\n"
            f"Options and their defaults (??? has none and must be given):\n\n{defaults}\n"
            f"Other overrides change the configuration: {others}.\n"
        )


def _key(text: str) -> str:
    """Return the key of an override, or its group."""
    return text.lstrip("+~").partition("=")[0]


def _root(text: str) -> str:
    """Return the first part of the key of an override, or its group."""
    return text.lstrip("+~").partition("=")[0].partition("@")[0].partition(".")[0]


def _combinations(overrides: list[Override], multirun: bool) -> list[list[str]]:
    """Return the overrides of each run, without sweeps."""
    swept = [override for override in overrides if override.is_sweep_override()]
    if swept and not multirun:
        raise ConfigError(f"{swept[0].input_line}: several values need -m (--multirun)")
    alternatives = [_alternatives(override) for override in overrides]
    return [list(combination) for combination in product(*alternatives)]


def _alternatives(override: Override) -> list[str]:
    if not override.is_sweep_override():
        return [str(override.input_line)]
    if isinstance(override.value(), Glob):
        raise ConfigError(f"{override.input_line}: glob is for train; list the values here")
    key = override.get_key_element()
    return [f"{key}={value}" for value in override.sweep_string_iterator()]


def check_file(path: str | Path, option: str) -> Path:
    """Return a file that is to be written.

    Args:
        path: The file; it may exist, and its folders need not.
        option: The option that named it; error messages begin with it.

    Raises:
        ConfigError: If it is a folder, or no file can be written there.
    """
    file = Path(path)
    if file.is_dir():
        raise ConfigError(f"{option}={path} is a folder; give a file")
    _check_parent(file.parent, f"{option}={path}")
    if file.exists() and not os.access(file, os.W_OK):
        raise ConfigError(f"{option}={path} cannot be written: no permission to change it")
    return file


def check_folder(path: str | Path, option: str) -> Path:
    """Return a folder in which files are to be written.

    Args:
        path: The folder; it need not exist.
        option: The option that named it; error messages begin with it.

    Raises:
        ConfigError: If it is a file, or no folder can be made there.
    """
    folder = Path(path)
    if folder.exists() and not folder.is_dir():
        raise ConfigError(f"{option}={path} is a file; give a folder")
    _check_parent(folder, f"{option}={path}")
    return folder


def _check_parent(folder: Path, given: str) -> None:
    """Raise `ConfigError` unless files can be made in `folder`, or it can be made itself."""
    existing = folder.absolute()
    while not existing.exists():
        existing = existing.parent
    if not existing.is_dir():
        raise ConfigError(f"{given} cannot be written: {existing} is not a folder")
    if not os.access(existing, os.W_OK):
        raise ConfigError(f"{given} cannot be written: no permission to write in {existing}")
