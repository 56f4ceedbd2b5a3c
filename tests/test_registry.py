import pytest
from refusals import naming

from veca_marl.registry import Registry


def define(value):
    """A class with the same dotted name at every call, as of a notebook cell that runs again."""

    class Entry:
        number = value

    return Entry


class Other:
    pass


def test_an_entry_defined_again_at_the_same_place_replaces_the_earlier_one():
    registry = Registry("thing")
    registry.add("a", define(1))
    registry.add("a", define(2))
    assert registry["a"].number == 2


def test_a_name_taken_by_another_definition_is_refused_and_both_are_named():
    registry = Registry("thing")
    registry.add("a", define(1))
    with pytest.raises(ValueError, match=naming("thing", "'a'", "Entry", "Other")):
        registry.add("a", Other)
    assert registry["a"].number == 1


def test_an_unknown_name_lists_the_choices_and_the_nearest():
    registry = Registry("thing")
    registry.add("ball", Other)
    with pytest.raises(ValueError, match=naming("thing", "'bal'", "ball")):
        registry.find("bal")


def test_listeners_receive_present_and_later_names():
    registry, heard = Registry("thing"), []
    registry.add("a", Other)
    registry.listen(heard.append)
    registry.add("b", define(1))
    assert heard == ["a", "b"]
    assert sorted(registry) == ["a", "b"]
