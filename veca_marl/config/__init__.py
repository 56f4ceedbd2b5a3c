"""The typed configuration: its dataclasses, its composition and its errors of one line."""

from veca_marl.config.compose import compose, compose_node, prepare, to_config
from veca_marl.config.errors import ConfigError, one_line
from veca_marl.config.root import Config, LogCfg
from veca_marl.plugins import conf_dir

__all__ = [
    "Config",
    "ConfigError",
    "LogCfg",
    "compose",
    "compose_node",
    "conf_dir",
    "one_line",
    "prepare",
    "to_config",
]
