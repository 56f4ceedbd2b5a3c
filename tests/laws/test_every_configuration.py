"""Every configuration class refuses impossible numbers in one line that names field and value."""

import math
from dataclasses import fields, is_dataclass

import pytest

from veca_marl.algos.algorithm import ALGORITHMS
from veca_marl.algos.collection.experience import CollectCfg
from veca_marl.algos.evaluation.evaluate import EvalCfg
from veca_marl.algos.intrinsic.intrinsic_reward import INTRINSICS
from veca_marl.algos.networks.factory import NETWORKS
from veca_marl.algos.selfplay import SelfPlayCfg
from veca_marl.checks import CheckCfg
from veca_marl.config.root import LogCfg, body_types
from veca_marl.datasets.baselines.learning import LearningCfg
from veca_marl.datasets.configuration import DATASETS
from veca_marl.envs.core.task import TASKS
from veca_marl.sim.physics import PLAYGROUND_GENERATORS, ClockCfg, PlaygroundCfg
from veca_marl.sim.senses import SENSES

OTHERS = (CheckCfg, ClockCfg, CollectCfg, EvalCfg, LearningCfg, LogCfg, PlaygroundCfg, SelfPlayCfg)
FLOATS = (math.nan, math.inf, -math.inf, -1.0, -1e9)
INTEGERS = (-1, -(10**9))


def classes():
    """Return all configuration classes that can be made without arguments."""
    registered = [*ALGORITHMS.values(), *INTRINSICS.values(), *NETWORKS.values(), *SENSES.values()]
    found = {entry.cfg_type for entry in registered if is_dataclass(entry.cfg_type)}
    found |= {task.cfg_type() for task in TASKS.values()}
    found |= {dataset.cfg_type for dataset in DATASETS.values()}
    found |= {*body_types().values(), *PLAYGROUND_GENERATORS.values(), *OTHERS}
    waiting = list(found)
    while waiting:
        base = waiting.pop()()
        inner = {type(value) for value in vars(base).values() if is_dataclass(value)}
        waiting += inner - found
        found |= inner
    ours = (one for one in found if one.__module__.startswith("veca_marl."))  # not those of tests
    return sorted(ours, key=lambda one: one.__qualname__)


CLASSES = classes()


def numbers(cfg_type):
    """Return the fields of a class that are numbers, with impossible ones for each."""
    base = cfg_type()
    values = {field.name: getattr(base, field.name) for field in fields(cfg_type) if field.init}
    return [
        (name, number)
        for name, value in values.items()
        if isinstance(value, (int, float)) and not isinstance(value, bool)
        for number in (FLOATS if isinstance(value, float) else INTEGERS)
    ]


def refusal(cfg_type, name, number):
    """Return the message with which a number is refused; None if it is accepted."""
    try:
        cfg_type(**{name: number})
    except ValueError as error:
        return str(error)
    return None


@pytest.mark.parametrize("cfg_type", CLASSES, ids=lambda each: each.__name__)
def test_refused_numbers_are_named_with_their_field(cfg_type):
    for name, number in numbers(cfg_type):
        message = refusal(cfg_type, name, number)
        if message is not None:
            assert name in message
            assert str(number) in message or f"{number:g}" in message
            assert "\n" not in message


@pytest.mark.parametrize("cfg_type", CLASSES, ids=lambda each: each.__name__)
def test_no_field_of_real_numbers_takes_one_that_is_none(cfg_type):
    accepted = [
        name
        for name, number in numbers(cfg_type)
        if math.isnan(number) and refusal(cfg_type, name, number) is None
    ]
    assert not accepted


def test_the_classes_are_found():
    """So many that the laws above are not about nothing."""
    assert len(CLASSES) > 40
    assert sum(len(numbers(cfg_type)) for cfg_type in CLASSES) > 800
