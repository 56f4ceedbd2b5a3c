"""Parts of TorchRL, TensorDict and torch that are used although their interfaces are private.

Each stands in `PRIVATE_PARTS` with the reason; a test finds all uses in the package and compares
them with this list. With a version of TorchRL that was not tested, the package warns once and uses
the public code where there is any.
"""

from __future__ import annotations

import warnings
from functools import cache
from importlib.metadata import version

TESTED_VERSIONS = ("0.14",)
"""Major and minor versions of TorchRL with which the tests pass."""

PRIVATE_PARTS = {
    "torchrl.envs.EnvBase._step_mdp": (
        "Computes the start of the next step; the general one is a tenth of a game of 2 ms. "
        "Public code on other versions."
    ),
    "torchrl.envs.EnvBase._step_proc_data": (
        "Checks the data of each step, which come from the specs. Public code on other versions."
    ),
    "tensordict.TensorDict._new_unsafe": (
        "Makes a tensordict without comparing shapes that come from a spec. The constructor on "
        "other versions."
    ),
    "torchrl.collectors.MultiSyncCollector._recv_and_check": (
        "Waits for a worker for ever; supervised collectors have a time limit. Without it on other "
        "versions."
    ),
    "torchrl.weight_update.SharedMemWeightSyncScheme._wait_for_ack": (
        "The same for the transfer of parameters; its queues are in `_ack_queues`. Without a time "
        "limit on other versions."
    ),
    "torchrl.objectives.ClipPPOLoss._log_weight": (
        "The only point at which old and new distribution are both known, for the analytic KL "
        "divergence and for entries that do not count."
    ),
    "torchrl.objectives.ClipPPOLoss._get_entropy": "Leaves out entries that do not count.",
    "torchrl.objectives.multiagent.MAPPOLoss._critic_loss_inputs": (
        "Normalises targets and values with statistics that are constant while a batch is learnt."
    ),
    "torchrl.data.LazyTensorStorage._init": (
        "The point at which a storage is made, to take all of its memory, or disk space, then."
    ),
    "torchrl.data.LazyTensorStorage._storage": "The arrays of a storage that was made.",
    "torchrl.data.LazyMemmapStorage._init": "As for `LazyTensorStorage`.",
    "torchrl.data.LazyMemmapStorage._storage": "As for `LazyTensorStorage`.",
    "torchrl.record.TensorboardLogger._create_experiment": (
        "TorchRL's hook of loggers: hides the points after the checkpoint of a resumed run."
    ),
    "torchrl.record.MLFlowLogger._create_experiment": (
        "The same hook: continues the run in MLflow when a run is resumed."
    ),
    "torch._foreach_lerp_": (
        "Moves all parameters of target networks at once, as the optimisers of torch do."
    ),
}
"""Dotted name of each part, and why it is used."""


@cache
def torchrl_is_tested() -> bool:
    """Return whether the installed version of TorchRL was tested; warn once if it was not."""
    installed = version("torchrl")
    if ".".join(installed.split(".")[:2]) in TESTED_VERSIONS:
        return True
    warnings.warn(
        f"veca_marl was tested with TorchRL {', '.join(TESTED_VERSIONS)}, this is {installed}: "
        "steps of environments take TorchRL's general path, and processes that collect have no "
        "time limit",
        stacklevel=2,
    )
    return False
