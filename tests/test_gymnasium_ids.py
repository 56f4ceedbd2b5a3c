"""The tasks' ids in Gymnasium's registry."""

import subprocess
import sys

import gymnasium
import pytest

import veca_marl
from veca_marl.envs.core.task import TASKS, Task, register_task
from veca_marl.gymnasium_ids import shipped_tasks

ID = "veca_marl/KickTheBall-v0"


def in_a_fresh_process(program):
    asked = [sys.executable, "-W", "ignore", "-c", program]
    return subprocess.run(asked, capture_output=True, text=True, check=True).stdout.strip()


def test_every_task_has_an_id():
    of_suites = veca_marl.list_tasks() + veca_marl.list_tasks(suite="babybench")
    assert shipped_tasks() == sorted(of_suites)
    assert {f"veca_marl/{task}-v0" for task in shipped_tasks()} <= set(gymnasium.registry)


@pytest.mark.parametrize(
    "imports",
    [
        "import gymnasium, veca_marl",
        "import veca_marl, gymnasium",
        "import veca_marl, gymnasium; gymnasium.register_envs(veca_marl)",
        "import veca_marl.sim, gymnasium",
    ],
)
def test_the_ids_exist_after_both_imports(imports):
    found = in_a_fresh_process(f"{imports}; print({ID!r} in gymnasium.registry)")
    assert found == "True"


@pytest.mark.slow
def test_neither_the_package_nor_the_simulator_loads_learning_libraries():
    program = (
        "import sys, veca_marl.sim.physics.world;"
        "print({'pettingzoo', 'torch', 'hydra'} & set(sys.modules))"
    )
    assert in_a_fresh_process(program) == "set()"


def test_a_task_that_is_registered_later_gets_an_id():
    assert "veca_marl/LaterTask-v0" not in gymnasium.registry
    register_task(type("LaterTask", (Task,), {}))
    try:
        assert gymnasium.spec("veca_marl/LaterTask-v0").kwargs == {"task": "LaterTask"}
    finally:
        del TASKS["LaterTask"], gymnasium.registry["veca_marl/LaterTask-v0"]
