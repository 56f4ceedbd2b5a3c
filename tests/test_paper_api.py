"""Every function that the paper's tables name exists where docs/reference/paper_api.md says."""

import importlib
import re
from pathlib import Path

import pytest

PAGE = Path(__file__).parent.parent / "docs" / "reference" / "paper_api.md"
ROW = re.compile(r"^\| ([^|]*) \| `(veca_marl[\w.]+)` \|", re.MULTILINE)
ROWS = ROW.findall(PAGE.read_text(encoding="utf-8"))
# both tables of the appendix, in their order
FUNCTIONS = [
    *("getImage", "getSpatialAudio", "getSpatialAudio", "getTactile", "getTactile"),
    *("AddObservations", "walk", "kick", "grab", "release", "adjustFocalLength"),
    *("lookTowardPoint", "releaseTowardPoint", "rotateUpDownHead", "rotateLeftRightHead"),
    *("makeSound", "isVisible", "isInteractable", "getInteractableObjects"),
    *("getInteractableObject", "GetVelocity", "GetAngVelocity", "GetAngles", "ApplyTorque"),
    "updateTaxels",
]
OTHER_NAMES = {  # the paper's name in our spelling, where it is not the translation of the name
    "AddObservations": "compute",
    "getInteractableObjects": "interactable_objects",
    "getInteractableObject": "interactable_object",
    "GetVelocity": "velocities",
    "GetAngVelocity": "angular_velocities",
    "GetAngles": "joint_angles",
}


def found(path):
    """Return the object with a dotted path, which begins with the name of a module."""
    parts = path.split(".")
    for count in range(len(parts), 0, -1):
        try:
            thing = importlib.import_module(".".join(parts[:count]))
        except ModuleNotFoundError:
            continue
        for name in parts[count:]:
            thing = getattr(thing, name)
        return thing
    raise AssertionError(f"no module in {path}")


@pytest.mark.parametrize(("_paper", "path"), ROWS, ids=[path for _, path in ROWS])
def test_every_entry_of_the_table_exists(_paper, path):
    assert callable(found(path))


def test_the_table_has_every_function_of_the_paper_under_its_name():
    listed = [re.match(r"`(\w+)\(", paper) for paper, _ in ROWS]
    names = [match[1] for match in listed if match]
    assert names == FUNCTIONS
    for match, (_, path) in zip(listed, ROWS, strict=True):
        if match:
            words = re.sub(r"(?<!^)([A-Z])", r"_\1", match[1]).lower()
            assert path.rpartition(".")[2] == OTHER_NAMES.get(match[1], words)


def test_the_table_has_the_actions_of_the_main_text():
    listed = {path.rpartition(".")[2] for _, path in ROWS}
    assert {"grab", "open", "step_on", "crawl"} <= listed
