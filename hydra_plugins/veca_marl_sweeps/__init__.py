"""Hydra's plug-ins of this project: a sweeper over the arms of an experiment, and a launcher.

Hydra instantiates sweepers and launchers from the namespace `hydra_plugins` alone. It imports this
module in every Hydra application of the environment, so that nothing slow is imported here.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import yaml
from hydra._internal.core_plugins.basic_sweeper import BasicSweeper
from hydra.core.config_store import ConfigStore
from hydra.core.override_parser.overrides_parser import OverridesParser
from hydra.core.utils import JobReturn, JobStatus, setup_globals
from hydra.errors import HydraException
from hydra.plugins.launcher import Launcher
from hydra.types import HydraContext, TaskFunction
from hydra.utils import get_class
from omegaconf import DictConfig, OmegaConf, open_dict
from omegaconf.errors import OmegaConfBaseException

from veca_marl.processes.cores import usable_cores
from veca_marl.sweeps.names import fixed_in, folder_of, key_of, run_name, varied_in
from veca_marl.sweeps.plans import Job, SweepError
from veca_marl.sweeps.run_state import final_score, read_run, with_body_kinds
from veca_marl.sweeps.sweep import run_sweep


class ArmSweeper(BasicSweeper):
    """Runs every arm of an experiment with every seed, and Hydra's sweeps without an experiment.

    A configuration with ``experiment.arms`` is run once for each arm and each of
    ``experiment.seeds``; a run has the overrides of its arm and ``experiment.arm=<name>``.
    ``experiment.arm=hrtf,mono`` chooses arms.
    """

    def sweep(self, arguments: list[str]) -> Any:
        """See `Sweeper`.

        Raises:
            SweepError: If several experiments are asked for, or one without seeds, or ``seed=``.
        """
        self._check(arguments)
        return super().sweep(arguments)

    def _check(self, arguments: list[str]) -> None:
        """Raise `SweepError` for arguments that would leave out arms or seeds without a word."""
        assert self.config is not None
        for override in OverridesParser.create().parse_overrides(arguments):
            if override.key_or_group == "experiment" and override.is_sweep_override():
                raise SweepError(f"{override.input_line}: one experiment per command")
        experiment = self.config.experiment
        if experiment.arms:
            names = [text.lstrip("+").partition("=")[0] for text in arguments]
            if "seed" in names:
                raise SweepError("seed: an experiment has experiment.seeds=[...]")
            if not experiment.seeds:
                raise SweepError(
                    f"experiment {experiment.name} has no seeds: give experiment.seeds=[0,1,2]"
                )

    def _parse_config(self) -> list[str]:
        """Return the parameters that are swept, as the base class does, with arms and seeds."""
        assert self.config is not None
        experiment = self.config.experiment
        swept: list[str] = super()._parse_config()
        if experiment.arms:
            swept.append(f"experiment.arm={','.join(experiment.arms)}")
            swept.append(f"seed={','.join(map(str, experiment.seeds))}")
        return swept

    def get_job_batch(self) -> Sequence[Sequence[str]]:
        """Return the overrides of each run, those of its arm included."""
        return [self._with_arm(job) for job in super().get_job_batch()]

    def validate_batch_is_legal(self, batch: Sequence[Sequence[str]]) -> None:
        """See `Sweeper`; the error says which run cannot be composed."""
        for overrides in batch:
            with _naming(" ".join(overrides)):
                super().validate_batch_is_legal([overrides])

    def _with_arm(self, job: Sequence[str]) -> list[str]:
        # here, and not above: it imports the simulator, which `train` has loaded
        from veca_marl.config.experiment import check_contradictions

        assert self.config is not None
        arms = self.config.experiment.arms
        chosen = [text.partition("=")[2] for text in job if text.startswith("experiment.arm=")]
        for arm in chosen:
            if arm not in arms:
                raise SweepError(f"experiment.arm={arm}: choices: {', '.join(arms)}")
            check_contradictions(arm, arms[arm], job)
        return [*job, *(text for arm in chosen for text in arms[arm])]


@contextmanager
def _naming(run: str) -> Iterator[None]:
    """Raise errors of a configuration as `ConfigError` with what the run is called in front."""
    # here, and not above: it imports the simulator, which `train` has loaded
    from veca_marl.config import ConfigError, one_line

    try:
        yield
    except (ConfigError, HydraException, OmegaConfBaseException) as error:
        raise ConfigError(f"{run}: {one_line(error)}") from error


class ProcessLauncher(Launcher):
    """Runs each job in a process of its own, several at a time; see `veca_marl.sweeps`.

    Args:
        jobs: Largest number of runs at a time; None is as many as the cores can run at once. Fewer
            run at a time where so many do not fit into the memory.
    """

    def __init__(self, jobs: int | None = None) -> None:
        self._jobs = jobs
        self._nodes: dict[Path, DictConfig] = {}  # folder of a job to its configuration

    def setup(
        self, *, hydra_context: HydraContext, task_function: TaskFunction, config: DictConfig
    ) -> None:
        """See `Launcher`; the task function is not used, each job is a command."""
        self._context, self._config = hydra_context, config

    def launch(
        self, job_overrides: Sequence[Sequence[str]], initial_job_idx: int
    ) -> Sequence[JobReturn]:
        """See `Launcher`.

        Raises:
            SweepError: If `jobs` is not positive, a folder holds a run of another configuration,
                two jobs have the same folder, or some jobs failed.
            ConfigError: If a run is impossible, or does not fit into the memory alone.
        """
        if self._jobs is not None and self._jobs < 1:
            raise SweepError(f"hydra.launcher.jobs must be at least 1, got {self._jobs}")
        setup_globals()
        jobs = [
            self._job(list(overrides), initial_job_idx + number)
            for number, overrides in enumerate(job_overrides)
        ]
        run_sweep(jobs, self._jobs, usable_cores(), self._fit)
        return [self._result(job) for job in jobs]

    def _result(self, job: Job) -> JobReturn:
        """Return what a sweeper learns of a job that has ended: its final score.

        Sweepers that optimise need it; those that only list combinations do not.
        """
        done = JobReturn(job.overrides, status=JobStatus.COMPLETED)
        if not issubclass(get_class(self._config.hydra.sweeper["_target_"]), BasicSweeper):
            try:
                done.return_value = final_score(
                    read_run(job.folder).rows("evaluations"), job.asked["experiment"]
                )
            except ValueError as error:
                raise SweepError(f"{job.name} has no score for the sweeper: {error}") from error
        return done

    def _fit(self, jobs: Sequence[Job], cores: int) -> int:
        """Return how many of the jobs fit on the machine together, each with some cores."""
        # here, and not above: they import torch, which `train` has loaded
        from veca_marl.config import to_config
        from veca_marl.runs.assembly import runs_at_once

        configs = {}
        for job in jobs:
            with _naming(job.name):
                configs[job.name] = to_config(self._nodes[job.folder])
        return runs_at_once(configs, cores)

    def _job(self, overrides: list[str], number: int) -> Job:
        # here, and not above: it imports the simulator, which `train` has loaded
        from veca_marl.config.stored import body_names

        config = self._context.config_loader.load_sweep_config(self._config, overrides)
        with open_dict(config):
            config.hydra.job.id = config.hydra.job.num = number
        sweep, name = self._place(config, overrides)
        hydra = self._config.hydra
        shared = [
            f"--config-dir={source.path}"
            for source in hydra.runtime.config_sources
            if source.provider == "command-line"
        ]
        shared += [text for text in hydra.overrides.hydra if "searchpath" in text]
        with open_dict(config):
            del config["hydra"]
        asked = yaml.safe_load(OmegaConf.to_yaml(config, resolve=True))
        self._nodes[sweep / name] = config
        asked = with_body_kinds(asked, body_names(config))
        return Job(name, sweep / name, [*shared, *overrides], asked)

    def _place(self, config: DictConfig, overrides: Sequence[str]) -> tuple[Path, str]:
        """Return the folder of the sweep, and that of a run within it.

        Those of a sweep without an experiment are named by what it varies, unless the command names
        them itself.
        """
        sweep, name = Path(str(config.hydra.sweep.dir)), str(config.hydra.sweep.subdir)
        if config.experiment.arm is not None:
            return sweep, name
        command = list(self._config.hydra.overrides.task)
        chosen = [key_of(text) for text in self._config.hydra.overrides.hydra]
        if "hydra.sweep.dir" not in chosen and config.experiment.name is None:
            sweep = folder_of(fixed_in(command))
        if "hydra.sweep.subdir" not in chosen:
            name = run_name(varied_in(overrides, command), int(config.seed))
        return sweep, name


def _store(group: str, name: str, plugin: type, fields: dict[str, Any]) -> None:
    """Store the fields of a plug-in; a dataclass cannot be made while Hydra loads this module."""
    node = {"_target_": f"{__name__}.{plugin.__name__}", **fields}
    ConfigStore.instance().store(group=group, name=name, node=node, provider="veca_marl")


_store("hydra/sweeper", "arms", ArmSweeper, {"max_batch_size": None, "params": {}})
_store("hydra/launcher", "processes", ProcessLauncher, {"jobs": None})
