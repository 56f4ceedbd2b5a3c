"""Memory that is left, by the files of the system in a temporary folder."""

import sys

import pytest

from veca_marl.algos.memory import available_memory

SLURM = "system.slice/slurmstepd.scope/job_7/step_0"


@pytest.fixture
def machine(tmp_path):
    """Write the files of a machine with 50 kB and of groups; return the bytes that are left."""

    def left(membership, groups=None):
        (tmp_path / "proc/self").mkdir(parents=True)
        (tmp_path / "proc/self/cgroup").write_text(membership)
        (tmp_path / "proc/meminfo").write_text("MemTotal:  99 kB\nMemAvailable:   50 kB\n")
        for folder, files in (groups or {}).items():
            (tmp_path / "sys/fs/cgroup" / folder).mkdir(parents=True, exist_ok=True)
            for name, text in files.items():
                (tmp_path / "sys/fs/cgroup" / folder / name).write_text(f"{text}\n")
        return available_memory(tmp_path)

    return left


def second(limit, used=400, cache=100):
    stat = f"anon 300\ninactive_file {cache}"
    return {"memory.max": limit, "memory.current": used, "memory.stat": stat}


def first(limit, used=400, cache=100):
    stat = f"inactive_file 1\ntotal_inactive_file {cache}"
    return {"memory.limit_in_bytes": limit, "memory.usage_in_bytes": used, "memory.stat": stat}


def test_in_a_namespace_the_limit_is_at_the_root(machine):
    assert machine("0::/\n", {".": second(1000)}) == 700


@pytest.mark.parametrize(
    ("membership", "groups"),
    [
        ("0::/\n", {".": second("max")}),
        ("0::/\n", {".": second(10**6)}),
        ("0::/a:b\n", {"a:b": {"memory.max": "max"}}),
        ("4:memory:/a\n", {"memory/a": first(9223372036854771712)}),
        ("", {}),
    ],
)
def test_without_a_smaller_limit_the_memory_of_the_system_counts(machine, membership, groups):
    assert machine(membership, groups) == 50 * 1024


@pytest.mark.parametrize("limited", [SLURM, "system.slice/slurmstepd.scope", "system.slice"])
def test_the_least_of_the_group_and_those_above_it_counts(machine, limited):
    groups = {SLURM: second(5000), "system.slice": second(4000, used=300), limited: second(1000)}
    assert machine(f"0::/{SLURM}\n", groups) == 700


@pytest.mark.parametrize("controllers", ["memory", "cpu,memory"])
def test_the_first_version_has_a_hierarchy_of_its_own(machine, controllers):
    membership = f"5:cpuset:/other\n4:{controllers}:/slurm/job_7\n0::/\n"
    groups = {"memory/slurm/job_7": first(1000), "memory/other": first(10), "memory": first(5000)}
    assert machine(membership, groups) == 700


@pytest.mark.parametrize("group", ["/docker/0123", "/../../outside", "/"])
def test_in_a_container_the_mount_is_the_group_where_its_path_is_not_mounted(machine, group):
    assert machine(f"4:memory:{group}\n", {"memory": first(1000)}) == 700


def test_a_system_without_these_files_does_not_say(tmp_path):
    assert available_memory(tmp_path) is None


@pytest.mark.skipif(sys.platform != "linux", reason="other systems have no /proc")
def test_this_machine_has_memory_left():
    assert available_memory() > 0
