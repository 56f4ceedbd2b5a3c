"""Traces of calls, and of one step of a task."""

from tools import trace_step


def outer():
    return [inner(n) for n in range(2)]


def inner(n):
    return n


def test_calls_of_a_package_are_counted_by_module():
    package = __name__.partition(".")[0]
    found = trace_step.trace(package, outer)
    calls = {code.co_name: number for (_, code), number in found.calls.items()}
    assert calls["outer"] == 1
    assert calls["inner"] == 2
    functions, total = found.modules()[__name__]
    assert (functions, total) == (len(calls), sum(calls.values()))


def test_calls_of_other_packages_are_not_counted():
    assert trace_step.trace("nothing", outer).calls == {}


def test_a_step_of_a_task_enters_modules_of_the_package(capsys):
    trace_step.main(["KickTheBall", "--warm", "1"])
    first, _, *rows = capsys.readouterr().out.splitlines()
    modules = int(first.split(": ")[1].split()[0])
    assert modules == len(rows) > 1
    assert all(row.split()[2].startswith("veca_marl.") for row in rows)
