"""Compiled kernels are cached outside the package, in folders that belong to their sources."""

import ast
import inspect
import os
import shutil
import subprocess
import sys
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest
from numba import types
from numba.core.dispatcher import Dispatcher

import veca_marl
from veca_marl.sim import kernel_cache, kernel_sources
from veca_marl.sim.kernel_cache import KEPT_FOLDERS
from veca_marl.sim.kernel_sources import KernelSources

SOURCES = {
    "__init__.py": (
        "from pathlib import Path\n"
        "from tiny.kernel_cache import configure_kernel_cache\n"
        "configure_kernel_cache(Path(__file__).parent)\n"
    ),
    "called.py": "from numba import njit\n@njit(cache=True)\ndef called():\n    return {value}\n",
    "caller.py": (
        "from numba import njit\nfrom tiny.called import called\n"
        "@njit(cache=True)\ndef caller():\n    return called()\n"
    ),
}
PROGRAM = (
    "from tiny.caller import caller; print(caller(), sum(caller.stats.cache_hits.values()), "
    "sum(caller.stats.cache_misses.values()))"
)


class TinyPackage:
    """A package with two kernels, one of which calls the other, in a folder that is read-only."""

    def __init__(self, root):
        self.root, self.folder, self.cache = root, root / "installed" / "tiny", root / "cache"
        self.folder.mkdir(parents=True)
        for module in (kernel_cache, kernel_sources):
            text = Path(module.__file__).read_text().replace("veca_marl.sim.", "tiny.")
            (self.folder / Path(module.__file__).name).write_text(text)
        self.write("__init__.py")
        self.write("caller.py")
        self.write("called.py", value=1)

    def write(self, name, text=None, **values):
        self.folder.chmod(0o755)
        (self.folder / name).write_text(text or SOURCES[name].format(**values))
        self.folder.chmod(0o555)

    def words(self, before=""):
        """Return the command that calls a kernel, after some other lines."""
        return [sys.executable, "-B", "-c", f"{before}\n{PROGRAM}"]

    def environment(self, **others):
        folders = {"XDG_CACHE_HOME": str(self.cache), "TMPDIR": str(self.root)}
        of_package = {"PYTHONPATH": str(self.folder.parent), "NUMBA_CACHE_DIR": ""}
        return os.environ | of_package | folders | others

    def call(self, before="", **environment):
        """Return the value, the hits and the misses of the cache of one call in a new process."""
        done = subprocess.run(
            self.words(before),
            cwd=self.root,
            env=self.environment(**environment),
            capture_output=True,
            text=True,
        )
        assert done.returncode == 0, done.stderr
        self.messages = done.stderr
        return tuple(map(int, done.stdout.split()))

    def files(self):
        return sorted(path.name for path in self.folder.rglob("*"))


@pytest.fixture
def tiny(tmp_path):
    return TinyPackage(tmp_path)


@pytest.mark.slow
def test_a_read_only_package_is_cached_elsewhere_and_not_written_to(tiny):
    before = tiny.files()
    assert tiny.call() == (1, 0, 1)
    assert tiny.call() == (1, 1, 0)
    assert tiny.files() == before
    assert list((tiny.cache / "veca_marl" / "kernels").rglob("caller.caller*.nbc"))


@pytest.mark.slow
def test_an_edit_of_a_called_function_in_another_file_is_noticed(tiny):
    assert tiny.call() == (1, 0, 1)
    tiny.write("called.py", value=2)
    assert tiny.call() == (2, 0, 1)
    tiny.write("called.py", value=1)
    assert tiny.call() == (1, 1, 0), "the kernels of the earlier sources are kept"


@pytest.mark.slow
def test_an_edit_of_what_a_kernel_does_not_import_leaves_it_valid(tiny):
    assert tiny.call() == (1, 0, 1)
    tiny.write("other.py", text="from tiny.caller import caller\n")
    assert tiny.call() == (1, 1, 0)


@pytest.mark.slow
def test_a_copy_of_the_package_with_the_same_sources_needs_no_compilation(tiny):
    assert tiny.call() == (1, 0, 1)
    shutil.copytree(tiny.folder, tiny.root / "copy" / "tiny")
    assert tiny.call(PYTHONPATH=str(tiny.root / "copy")) == (1, 1, 0)


@pytest.mark.slow
def test_processes_that_start_at_the_same_time_share_the_folder(tiny):
    with ThreadPoolExecutor() as pool:
        values = [value for value, *_ in pool.map(lambda _: tiny.call(), range(2))]
    assert values == [1, 1]
    assert tiny.call() == (1, 1, 0)


def test_a_directory_that_the_user_has_chosen_is_used(tiny, tmp_path):
    chosen = {"NUMBA_CACHE_DIR": str(tmp_path / "chosen")}
    assert tiny.call(**chosen) == (1, 0, 1)
    assert list((tmp_path / "chosen").rglob("caller.caller*.nbc"))
    assert not tiny.cache.exists()
    tiny.write("called.py", value=2)
    assert tiny.call(**chosen) == (2, 0, 1)


def test_without_a_writable_cache_directory_a_temporary_one_is_used_and_named(tiny):
    tiny.cache.write_text("a file where the folder should be")
    assert tiny.call() == (1, 0, 1)
    assert str(tiny.root) in tiny.messages
    assert "NUMBA_CACHE_DIR" in tiny.messages


def caches(tiny):
    return {path.name for path in (tiny.cache / "veca_marl" / "kernels").iterdir()}


def test_of_each_file_only_the_folders_used_last_are_kept(tiny):
    parent = tiny.cache / "veca_marl" / "kernels"
    old = [f"tiny.caller-{age:016x}" for age in range(2 * KEPT_FOLDERS)]
    others = [f"tiny.other-{age:016x}" for age in range(2 * KEPT_FOLDERS)]
    for age, name in enumerate(old + others):
        (parent / name).mkdir(parents=True)
        os.utime(parent / name, (1e9 - age, 1e9 - age))
    tiny.call()
    used = {name for name in caches(tiny) - {*old, *others} if name.startswith("tiny.caller")}
    assert len(used) == 1
    assert caches(tiny) >= {*old[: KEPT_FOLDERS - 1], *others}
    assert not caches(tiny) & set(old[KEPT_FOLDERS - 1 :])


def test_what_is_no_cache_is_never_deleted(tiny):
    """Folders and files of other names, and links with the name of a cache."""
    parent, foreign = tiny.cache / "veca_marl" / "kernels", tiny.root / "thesis"
    parent.mkdir(parents=True)
    for folder in (foreign, *(parent / f"tiny.caller-photos {n}" for n in range(2 * KEPT_FOLDERS))):
        folder.mkdir()
        (folder / "kept.txt").touch()
        os.utime(folder, (1e9, 1e9))
    for number in range(2 * KEPT_FOLDERS):
        (parent / f"tiny.caller-{number:016x}").symlink_to(foreign)
        (parent / f"tiny.caller-{number + 100:016x}").touch()
    before = caches(tiny)
    tiny.call()
    assert caches(tiny) > before
    assert len(list(tiny.root.rglob("kept.txt"))) == 2 * KEPT_FOLDERS + 1


def test_the_digest_depends_on_the_names_and_contents_of_what_is_imported(tmp_path):
    package, texts = tmp_path / "tiny", {"a.py": "from tiny import b, c", "b.py": "x", "c.py": "y"}

    def digest(**changes):
        shutil.rmtree(package, ignore_errors=True)
        package.mkdir()
        for name, text in (texts | {f"{name}.py": text for name, text in changes.items()}).items():
            (package / name).write_text(text)
        sources = KernelSources(package)
        return sources.digest(package / "a.py"), sources.digest_of_all()

    first = digest()
    changed = [
        digest(a="from tiny import b, c\n"),
        digest(a="import tiny.b"),
        digest(b="xx"),
        digest(b="import tiny.c"),
        digest(c="z"),
    ]
    assert len({first[0], *(one for one, _ in changed)}) == 1 + len(changed)
    assert digest(d="unused")[0] == first[0]
    assert digest(d="unused")[1] != first[1]


def test_imports_are_those_that_the_parser_finds():
    """In every file of the package; a name that is imported may be a module itself."""
    package = Path(veca_marl.__file__).parent
    sources = KernelSources(package)
    files = {sources.module(file): file for file in package.rglob("*.py")}
    files |= {name.removesuffix(".__init__"): file for name, file in files.items()}
    for file in package.rglob("*.py"):
        found = sources.imports(file)
        assert set(filter(None, map(files.get, imported(file)))) <= found, file
        assert found <= set(files.values())


def imported(file):
    """Yield the modules that a file imports and the names that it imports from them."""
    for node in ast.walk(ast.parse(file.read_text())):
        if isinstance(node, ast.ImportFrom):
            assert not node.level, "an import by a relative name"
            yield from (node.module, *(f"{node.module}.{alias.name}" for alias in node.names))
        elif isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)


@pytest.mark.parametrize("task", ["KickTheBall", "TurnBaby"])
def test_named_tuples_that_a_kernel_is_given_are_defined_in_what_its_module_imports(task):
    """numba knows them by name: other fields in another order would find the old kernel."""
    env = veca_marl.make(task, seed=0)
    env.rollout(1)
    env.close()
    sources = KernelSources(Path(veca_marl.__file__).parent)
    found = 0
    for kernel in kernels():
        closure = sources.closure(Path(inspect.getfile(kernel.py_func)))
        for signature in set(kernel.overloads) | stored_signatures(kernel):
            for given in named_tuples(signature):
                found += 1
                assert Path(inspect.getfile(given)) in closure, (kernel, given)
    assert found > 10


def kernels():
    """Return all kernels of the modules that are imported."""
    modules = [module for name, module in sys.modules.items() if name.startswith("veca_marl.")]
    named = {id(value): value for module in modules for value in vars(module).values()}
    return [v for v in named.values() if isinstance(v, Dispatcher)]


def stored_signatures(kernel):
    return {key[0] for key in kernel._cache._cache_file._load_index()}


def named_tuples(given):
    """Yield the classes of the named tuples in a type or in a signature."""
    if isinstance(given, (types.NamedTuple, types.NamedUniTuple)):
        yield given.instance_class
    if isinstance(given, (tuple, types.BaseTuple)):
        for part in given:
            yield from named_tuples(part)


def test_kernels_do_not_depend_on_most_of_the_simulator():
    """A change of a body leaves the kernels of the eyes and of sound valid."""
    package = Path(veca_marl.__file__).parent
    for file in ("vision/renderer.py", "sound/attenuated_paths.py", "touch/contact.py"):
        reached = KernelSources(package).closure(package / "sim" / file)
        assert not any("/body/walker/" in path.as_posix() for path in reached)


def entries(tiny, kind):
    return sorted((tiny.cache / "veca_marl" / "kernels").rglob(f"*.{kind}"))


def cut(path):
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 2])


def change_a_byte(path):
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)


DAMAGES = {
    "cut": cut,
    "empty": lambda path: path.write_bytes(b""),
    "changed": change_a_byte,
    "foreign": lambda path: path.write_bytes(b"text"),
}


QUICK = (("empty", "nbi"), ("cut", "nbc"))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("damage", "kind"),
    [
        pytest.param(damage, kind, marks=() if (damage, kind) in QUICK else pytest.mark.slow)
        for damage in DAMAGES
        for kind in ("nbi", "nbc")
    ],
)
def test_a_damaged_entry_is_named_and_compiled_again(tiny, kind, damage):
    assert tiny.call() == (1, 0, 1)
    for path in entries(tiny, kind):
        DAMAGES[damage](path)
    damaged = next(path for path in entries(tiny, kind) if path.name.startswith("caller"))
    assert tiny.call() == (1, 0, 1)
    assert str(damaged) in tiny.messages
    assert tiny.call() == (1, 1, 0)
    assert not tiny.messages


NO_ROOM = """
import errno, os, tempfile
def refuse(*_, **__):
    raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
"""
REFUSALS = {
    "a new folder": "os.makedirs = os.mkdir = refuse\n",
    "a file of the cache": (
        "from numba.core.caching import IndexDataCacheFile\n"
        "IndexDataCacheFile._save_data = refuse\n"
    ),
    "any temporary file": "tempfile.TemporaryFile = tempfile.mkdtemp = refuse\n",
}


@pytest.mark.slow
@pytest.mark.parametrize("refusal", REFUSALS.values(), ids=REFUSALS)
def test_on_a_full_disk_kernels_are_compiled_without_a_cache(tiny, refusal):
    assert tiny.call(before=NO_ROOM + refusal) == (1, 0, 1)
    assert "not cached" in tiny.messages
    assert tiny.call() == (1, 0, 1)
    assert not tiny.messages
    assert tiny.call() == (1, 1, 0)


SLOW_COMPILER = """
import time
from pathlib import Path
from numba.core.compiler import CompilerBase
compile_extra = CompilerBase.compile_extra
def slowly(self, function):
    with Path("compiled").open("a") as file:
        file.write(function.__name__ + "\\n")
    time.sleep(2.0)
    return compile_extra(self, function)
CompilerBase.compile_extra = slowly
"""


@pytest.mark.slow
def test_of_processes_that_start_together_one_compiles(tiny):
    with ThreadPoolExecutor() as pool:
        calls = [pool.submit(tiny.call, before=SLOW_COMPILER) for _ in range(3)]
    assert [call.result()[0] for call in calls] == [1, 1, 1]
    assert sorted((tiny.root / "compiled").read_text().split()) == ["called", "caller"]


def test_a_process_that_was_killed_while_it_compiled_is_not_waited_for(tiny):
    first = subprocess.Popen(
        tiny.words(SLOW_COMPILER.replace("2.0", "600.0")), cwd=tiny.root, env=tiny.environment()
    )
    while not (tiny.root / "compiled").exists():
        assert first.poll() is None  # it has not ended with an error
        time.sleep(0.05)
    with ThreadPoolExecutor() as pool:
        second = pool.submit(tiny.call)
        time.sleep(1.0)
        first.kill()
        first.wait()
        assert second.result() == (1, 0, 1)


@pytest.mark.slow
def test_a_process_that_hangs_is_waited_for_only_so_long(tiny):
    first = subprocess.Popen(
        tiny.words(SLOW_COMPILER.replace("2.0", "600.0")), cwd=tiny.root, env=tiny.environment()
    )
    while not (tiny.root / "compiled").exists():
        assert first.poll() is None  # it has not ended with an error
        time.sleep(0.05)
    shorter = "import tiny.kernel_cache\ntiny.kernel_cache._LONGEST_WAIT_S = 0.5\n"
    assert tiny.call(before=shorter) == (1, 0, 1)
    assert "waiting" in tiny.messages
    first.kill()
    first.wait()
