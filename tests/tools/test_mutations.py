"""The list of seeded faults fits the package, and a fault is seeded and taken out again."""

import pytest

from tools.checkout import ROOT
from tools.mutations import Mutation, MutationError, chosen, is_noticed, read_mutations, seeded

MUTATIONS = read_mutations()


def test_there_are_forty_faults_with_names_of_their_own():
    assert len({mutation.name for mutation in MUTATIONS}) == len(MUTATIONS) >= 40


@pytest.mark.parametrize("mutation", MUTATIONS, ids=lambda mutation: mutation.name)
def test_a_fault_changes_its_module_once_and_names_tests(mutation):
    source = (ROOT / mutation.file).read_text(encoding="utf-8")
    compile(mutation.seeded(source), mutation.file, "exec")
    assert mutation.seeded(source) != source
    assert mutation.tests
    assert all((ROOT / test).exists() for test in mutation.tests)


@pytest.fixture
def copy(tmp_path):
    """A project of one module and one test."""
    (tmp_path / "sums.py").write_text("def add(a, b):\n    return a + b\n", encoding="utf-8")
    test = "from sums import add\n\n\ndef test_add():\n    assert add(2, 3) == 5\n"
    (tmp_path / "test_sums.py").write_text(test, encoding="utf-8")
    return tmp_path


def fault(new):
    return Mutation("a sum is wrong", "sums.py", "a + b", new, ("test_sums.py",))


@pytest.mark.parametrize(("new", "noticed"), [("a - b", True), ("b + a", False)])
def test_a_fault_is_noticed_if_a_test_fails(copy, new, noticed):
    assert is_noticed(fault(new), copy, ["test_sums.py"]) is noticed
    assert "a + b" in (copy / "sums.py").read_text(encoding="utf-8")


def test_a_fault_is_taken_out_after_an_error(copy):
    def stop():
        assert "a - b" in (copy / "sums.py").read_text(encoding="utf-8")
        raise RuntimeError("stop")

    with pytest.raises(RuntimeError, match="stop"), seeded(fault("a - b"), copy):
        stop()
    assert "a + b" in (copy / "sums.py").read_text(encoding="utf-8")


def test_tests_that_cannot_run_and_names_that_are_unknown_are_errors(copy):
    with pytest.raises(MutationError):
        is_noticed(fault("a - b"), copy, ["test_products.py"])
    with pytest.raises(MutationError, match="products"):
        chosen(MUTATIONS, ["products"])
    assert chosen(MUTATIONS, [MUTATIONS[3].name]) == [MUTATIONS[3]]
