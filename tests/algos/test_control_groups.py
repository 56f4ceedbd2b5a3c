"""Limits of control groups as the files of the system state them, in a temporary folder."""

import pytest

from veca_marl.algos.storage import control_group_memory

SLURM = "system.slice/slurmstepd.scope/job_7/step_0"


@pytest.fixture
def machine(tmp_path):
    """Write the files of groups; return what their limits leave."""

    def left(membership, groups=None):
        (tmp_path / "cgroup").write_text(membership)
        for folder, files in (groups or {}).items():
            (tmp_path / "fs" / folder).mkdir(parents=True, exist_ok=True)
            for name, text in files.items():
                (tmp_path / "fs" / folder / name).write_text(f"{text}\n")
        return control_group_memory(tmp_path / "cgroup", tmp_path / "fs")

    return left


def second(limit, used=400, cache=100):
    stat = f"anon 300\ninactive_file {cache}"
    return {"memory.max": limit, "memory.current": used, "memory.stat": stat}


def first(limit, used=400, cache=100):
    stat = f"inactive_file 1\ntotal_inactive_file {cache}"
    return {"memory.limit_in_bytes": limit, "memory.usage_in_bytes": used, "memory.stat": stat}


def test_in_a_namespace_the_limit_is_at_the_root(machine):
    assert machine("0::/\n", {".": second(1000)}) == 700
    assert machine("0::/\n", {".": second("max")}) is None


def test_without_a_namespace_the_limit_is_in_the_folder_of_the_group(machine):
    assert machine(f"0::/{SLURM}\n", {SLURM: second(1000)}) == 700


@pytest.mark.parametrize("limited", [SLURM, "system.slice/slurmstepd.scope", "system.slice"])
def test_the_least_of_the_group_and_those_above_it_counts(machine, limited):
    groups = {SLURM: second(5000), "system.slice": second(4000, used=300), limited: second(1000)}
    assert machine(f"0::/{SLURM}\n", groups) == 700


@pytest.mark.parametrize("controllers", ["memory", "cpu,memory"])
def test_the_first_version_has_a_hierarchy_of_its_own(machine, controllers):
    membership = f"5:cpuset:/other\n4:{controllers}:/slurm/job_7\n0::/\n"
    groups = {"memory/slurm/job_7": first(1000), "memory/other": first(10), "memory": first(5000)}
    assert machine(membership, groups) == 700


def test_a_limit_as_large_as_the_first_version_writes_without_one_is_none(machine):
    assert machine("4:memory:/a\n", {"memory/a": first(9223372036854771712)}) is None


def test_both_versions_on_one_machine(machine):
    groups = {"memory/a": first(2000), "unified/b": second(1000)}
    assert machine("4:memory:/a\n0::/b\n", groups) == 700


@pytest.mark.parametrize("group", ["/docker/0123", "/../../outside", "/"])
def test_in_a_container_the_mount_is_the_group_where_its_path_is_not_mounted(machine, group):
    assert machine(f"4:memory:{group}\n", {"memory": first(1000)}) == 700


def test_paths_do_not_lead_out_of_the_mount(machine):
    assert machine("0::/../outside\n", {"../outside": second(10), ".": second(1000)}) == 700


def test_a_group_without_limits_and_a_system_without_groups(machine, tmp_path):
    assert machine("0::/a:b\n", {"a:b": {"memory.max": "max"}}) is None
    assert control_group_memory(tmp_path / "absent", tmp_path) is None
