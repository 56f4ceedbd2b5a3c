"""The commit in provenance.json is that of the package's own checkout, or None."""

import subprocess

import pytest

from veca_marl.runs.run_folder import checkout_commit


def git(folder, *arguments):
    settings = ["-c", "user.name=test", "-c", "user.email=test@example.com"]
    done = subprocess.run(
        ["git", *settings, *arguments], cwd=folder, capture_output=True, text=True, check=True
    )
    return done.stdout.strip()


@pytest.fixture
def repository(tmp_path):
    """A repository with one commit that tracks `veca_marl/__init__.py`."""
    git(tmp_path, "init", "-q")
    add_package(tmp_path)
    git(tmp_path, "add", "-A")
    git(tmp_path, "commit", "-q", "-m", "First")
    return tmp_path


def add_package(folder):
    (folder / "veca_marl").mkdir(parents=True)
    (folder / "veca_marl" / "__init__.py").write_text("")
    return folder / "veca_marl"


def test_a_checkout_reports_its_commit_and_its_changes(repository, monkeypatch):
    head = git(repository, "rev-parse", "HEAD")
    assert checkout_commit(repository / "veca_marl") == head
    monkeypatch.setenv("GIT_DIR", "/elsewhere/.git")
    assert checkout_commit(repository / "veca_marl") == head
    (repository / "veca_marl" / "__init__.py").write_text("changed = True\n")
    assert checkout_commit(repository / "veca_marl") == f"{head}-dirty"


def test_an_environment_inside_another_repository_has_no_commit(repository):
    installed = add_package(repository / ".venv" / "lib" / "python3.11" / "site-packages")
    assert checkout_commit(installed) is None


def test_a_package_that_is_not_tracked_by_the_repository_around_it_has_no_commit(tmp_path):
    git(tmp_path, "init", "-q")
    git(tmp_path, "commit", "-q", "--allow-empty", "-m", "First")
    assert checkout_commit(add_package(tmp_path)) is None


def test_without_a_repository_there_is_no_commit(tmp_path):
    assert checkout_commit(add_package(tmp_path)) is None
