"""The site builds, and its generated pages are those of the code and data of this commit."""

import ast
import dataclasses
import importlib
import inspect
import io
import itertools
import json
import pkgutil
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
from docutils.core import publish_doctree
from sphinx.ext import napoleon

import veca_marl
from tools import make_docs
from tools.docs_pages.api_page import public_names
from tools.docs_pages.bodies_of_tasks import DISCRETE_BODIES
from tools.docs_pages.body_tables import body_page
from tools.docs_pages.docstrings import entries, prose
from tools.docs_pages.observation_page import MEANINGS, all_specs
from tools.docs_pages.parts_picture import parts_picture
from tools.docs_pages.pictures import perception_picture, task_picture, touch_picture
from tools.docs_pages.playground_page import from_above, playground, playgrounds
from tools.docs_pages.tables import text
from tools.docs_pages.task_pages import built_in_tasks, task_page
from veca_marl import extend, list_tasks
from veca_marl.config import ConfigError, compose
from veca_marl.envs.core.game import Game
from veca_marl.envs.core.task import TASKS, find_task
from veca_marl.plugins import conf_dir
from veca_marl.sim.body.anatomy import limit_sources
from veca_marl.sim.body.humanoid import HumanoidCfg

ROOT = Path(__file__).resolve().parent.parent
DOCS = ROOT / "docs"

SLOW_PAGES = ("reference/actions.md", "reference/observations.md")  # a world of each task


def read(name):
    return (DOCS / name).read_text(encoding="utf-8")


def build_site(folder, *options):
    """Return the warnings of a build of the site."""
    command = [sys.executable, "-m", "sphinx", "-q", "--keep-going", *options, "-b", "html"]
    command += ["-d", folder / "doctrees", DOCS, folder / "html"]
    build = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (folder / "html" / "index.html").exists(), build.stderr
    return build.stderr.splitlines()


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    """The folder of the whole site, and the warnings of its build: most of it is the API."""
    folder = tmp_path_factory.mktemp("site")
    warnings = build_site(folder)
    return folder / "html", warnings


@pytest.mark.slow
def test_the_site_builds_without_a_warning(site):
    folder, warnings = site
    assert warnings == []
    assert (folder / "api" / "veca_marl.html").exists()


@pytest.mark.slow
def test_the_site_has_types_sources_and_links_and_loads_nothing_from_elsewhere(site):
    folder, _ = site
    api = (folder / "api" / "veca_marl.html").read_text(encoding="utf-8")
    made = api.partition('id="veca_marl.api.make"')[2].partition("</dt>")[0]
    for part in ("worlds", "int", "VecaEnv", "[source]"):
        assert part in made
    task = "veca_marl.envs.core.task.Task"
    for page in ("guides/add_a_task.html", "tasks/KickTheBall.html", "reference/api.html"):
        assert 'title="veca_marl.' in (folder / page).read_text(encoding="utf-8"), page
    names = (folder / "reference" / "api.html").read_text(encoding="utf-8")
    for name in (task, "veca_marl.api.train", "veca_marl.api.make"):
        assert f'title="{name}"' in names
    installation = (folder / "getting_started" / "installation.html").read_text(encoding="utf-8")
    assert 'title="veca_marl.api.make"' not in installation  # the command make
    assert "<math" in (folder / "reference" / "touch.html").read_text(encoding="utf-8")
    loaded = re.compile(r"<(?:script|link|img)[^>]*(?:src|href)=\"https?://")
    pages = [page for page in folder.rglob("*.html") if "_downloads" not in page.parts]
    assert [page.name for page in pages if loaded.search(page.read_text(encoding="utf-8"))] == []


@pytest.mark.slow
@pytest.mark.skipif(shutil.which("node") is None, reason="needs node")
def test_the_search_lists_public_names_first(site):
    folder, _ = site
    public = {name: f"{one.__module__}.{one.__qualname__}" for name, one in public_names()}
    wanted = {name: public[name] for name in ("make", "Body", "Task", "Sense", "PropCfg", "Walker")}
    wanted["palms"] = f"{public['Body']}.palms"
    script = ROOT / "tests" / "helpers" / "site_search.js"
    words = ["node", str(script), str(folder), *wanted]
    found = subprocess.run(words, capture_output=True, text=True, check=True).stdout.splitlines()
    first = {name: json.loads(line)[0] for name, line in zip(wanted, found, strict=True)}
    assert first == wanted


def test_every_name_for_plug_ins_is_on_the_page_of_public_names():
    page = read("reference/api.md")
    named = set(re.findall(r"^\| `(\w+)` \|", page, re.M))
    assert set(extend.__all__) | {"make", "gym_env", "parallel_env", "check_task"} <= named


@pytest.mark.slow
def test_the_written_pages_build_without_a_warning(tmp_path):
    warnings = build_site(tmp_path, "-t", "written_pages")
    (missing,) = warnings
    assert "index.md" in missing
    assert "'api/modules'" in missing


MODULES = sorted(
    module.name
    for module in pkgutil.walk_packages(veca_marl.__path__, "veca_marl.")
    if not module.name.endswith("__main__")
)


def docstrings(module):
    """Yield the docstrings of a module, and of its classes, functions, methods and properties."""
    yield module.__doc__
    for thing in vars(module).values():
        if getattr(thing, "__module__", None) == module.__name__ and callable(thing):
            yield thing.__doc__
            members = vars(thing).values() if inspect.isclass(thing) else ()
            yield from (m.__doc__ for m in members if inspect.isfunction(m) or type(m) is property)


def as_restructured_text(docstring):
    """Return a docstring as the API reference reads it, see docs/conf.py."""
    sections = [("Terms", "params_style"), ("Observations", "params_style")]
    style = napoleon.Config(napoleon_use_ivar=True, napoleon_custom_sections=sections)
    return str(napoleon.GoogleDocstring(inspect.cleandoc(docstring or ""), style))


@pytest.mark.slow
def test_docstrings_are_valid_restructured_text():
    """Quicker than the API reference, see test_the_site_builds_without_a_warning."""
    for module in map(importlib.import_module, MODULES):
        texts = [".. default-role:: code", *map(as_restructured_text, docstrings(module))]
        warnings = io.StringIO()
        publish_doctree("\n\n".join(texts), settings_overrides={"warning_stream": warnings})
        assert not warnings.getvalue(), module.__name__


def docstrings_of_attributes(tree):
    """Yield the strings below assignments, which Sphinx reads as their docstrings."""
    for node in ast.walk(tree):
        body = getattr(node, "body", None)
        for above, below in itertools.pairwise(body if isinstance(body, list) else []):
            match above, below:
                case (ast.Assign() | ast.AnnAssign(), ast.Expr(ast.Constant(str(docstring)))):
                    yield docstring


def test_no_docstring_of_an_attribute_has_a_colon_in_its_first_line():
    """The style reads what is before the colon as a type, and its words as references."""
    found = [
        (path.name, docstring)
        for path in Path(veca_marl.__file__).parent.rglob("*.py")
        for docstring in docstrings_of_attributes(ast.parse(path.read_text(encoding="utf-8")))
        if ":" in docstring.splitlines()[0]
    ]
    assert found == []


@pytest.mark.slow
@pytest.mark.parametrize("name", built_in_tasks())
def test_the_page_of_a_task_is_current(name):
    assert read(f"tasks/{name}.md") == task_page(find_task(name)), "run make pages"


def rows_of(page, section):
    """Return the rows of the table in a section of a page: name to the cells that follow."""
    lines = page.split(f"\n## {section}\n")[1].split("\n## ")[0].splitlines()
    cells = [line.strip("| ").split(" | ") for line in lines if line.startswith("| `")]
    return {name.strip("`"): values for name, *values in cells}


@pytest.mark.slow
@pytest.mark.parametrize("name", built_in_tasks())
def test_the_defaults_on_the_page_of_a_task_are_those_of_its_preset(name):
    page, task = read(f"tasks/{name}.md"), compose([f"+task={name}"]).game.task
    fields = [field.name for field in dataclasses.fields(task)]
    parameters = rows_of(page, "Parameters")
    assert set(parameters) == set(fields) - {"name", "weights"}
    for field, (_, value, _) in parameters.items():
        assert value.split("`")[1] == text(getattr(task, field)), field
    weights = {
        term: value.partition(" per ") for term, (value, _) in rows_of(page, "Reward terms").items()
    }
    assert {term: float(number) for term, (number, *_) in weights.items()} == task.weights
    rates = {term for term, (*_, step) in weights.items() if step == "40 ms"}
    assert rates == set(find_task(name).rates)


@pytest.mark.slow
@pytest.mark.parametrize("name", list_tasks())
def test_the_page_of_a_task_tells_its_default_body_from_that_of_the_paper(name):
    page, body = read(f"tasks/{name}.md"), compose([f"+task={name}"]).game.body
    is_reduced = isinstance(body, HumanoidCfg) and body != compose(["+task=GrabObject"]).game.body
    assert ("82 joints move, knuckles included: `body=full`" in page) == is_reduced
    assert ("in the paper within 1.5 m" in page) == (body.interaction_range_m != 1.5)
    if is_reduced:
        compose([f"+task={name}", "body=full"])


@pytest.mark.parametrize(("name", "body"), DISCRETE_BODIES.items())
def test_the_discrete_form_of_a_task_has_no_continuous_action(name, body):
    game = Game(compose([f"+task={name}", f"body={body}"]).game)
    specs = [spec for player in game.players for spec in player.body.action_spec.values()]
    game.close()
    assert all(spec.is_discrete for spec in specs)
    assert f"`body={body}`" in read(f"tasks/{name}.md")


@pytest.mark.parametrize("name", built_in_tasks())
def test_every_reward_term_of_a_task_is_documented_and_has_a_picture(name):
    task = find_task(name)
    assert set(entries(task, "Terms")) == set(task.cfg_type()().weights)
    assert (DOCS / "images" / "tasks" / f"{name}.png").exists()


@pytest.mark.golden
@pytest.mark.parametrize(
    "name",
    [
        pytest.param(name, marks=[pytest.mark.slow] * (name in SLOW_PAGES))
        for name in make_docs.PAGES
    ],
)
def test_a_generated_page_is_current(name):
    assert read(name) == make_docs.PAGES[name](), "run make pages"


def test_the_observation_reference_has_every_key_that_an_environment_observes():
    assert set(all_specs()) == set(MEANINGS)


def test_the_tables_of_the_body_are_those_of_the_data():
    page = read("reference/body.md")
    assert page == body_page(page), "run make pages"
    rows = [line for line in page.splitlines() if line.startswith("| `")]
    bones = [row for row in rows if " mm, " in row]
    joints = [row for row in rows if " N m " in row]
    # 5 bones and 12 joints in the middle, 21 and 35 on each side
    assert (len(bones), len(joints)) == (5 + 21, 12 + 35)


def test_every_source_of_a_joint_range_is_explained():
    sources = {source for both in limit_sources() for source in both}
    explained = read("reference/body.md").split("Sources of the ranges")[1]
    assert sources == set(re.findall(r"\*\*(\w+)\*\*", explained))


def test_every_preset_of_the_body_is_on_its_page():
    presets = {path.stem for path in (conf_dir() / "body").glob("*.yaml")}
    table = read("reference/body.md").split("## Presets")[1].split("##")[0]
    assert presets <= set(re.findall(r"`(\w+)`", table))


class Documented:
    """Summary.

    Attributes:
        width: Pixels of
            an image.
        height: Others.

    Raises:
        ValueError: Never.
    """


def test_a_docstring_is_read_section_by_section():
    assert prose(Documented) == "Summary."
    assert entries(Documented, "Attributes") == {
        "width": "Pixels of an image.",
        "height": "Others.",
    }
    assert entries(Documented, "Returns") == {}


@pytest.mark.slow
def test_the_pictures_can_be_drawn(tmp_path):
    task_picture("KickTheBall", tmp_path / "walker.png")
    task_picture("TurnBaby", tmp_path / "joints.png")
    perception_picture(tmp_path / "perception.png")
    touch_picture(tmp_path / "touch.png")
    parts_picture(tmp_path / "skin_parts.png")
    assert all(path.stat().st_size > 5000 for path in tmp_path.glob("*.png"))
    assert len(list(tmp_path.glob("*.png"))) == 5


def test_every_playground_has_a_picture_from_above():
    for name in playgrounds():
        assert (DOCS / "images" / "playgrounds" / f"{name}.png").exists(), "run make pages"
    image = from_above(playground("simple"))
    floor = image[image.shape[0] // 2, image.shape[1] // 2]
    wall = image[image.shape[0] // 2, 0]
    assert (floor != wall).any()


def test_the_changelog_and_the_citation_have_the_version_of_the_package():
    changelog = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8")
    assert re.findall(r"^## \[(\d\S*)\]", changelog, re.M)[0] == veca_marl.__version__
    assert f"version: {veca_marl.__version__}\n" in (ROOT / "CITATION.cff").read_text()


@pytest.mark.slow
def test_the_table_of_playgrounds_that_are_refused_is_true():
    page = read("reference/playgrounds.md")
    places = sorted(path.stem for path in (Path(conf_dir()) / "playground").glob("*.yaml"))
    refused = {}
    for row in re.findall(r"^\| (\w.*?) \| (.*?) \| .* \|$", page, re.MULTILINE):
        tasks, names = row[0].split(", "), set(re.findall(r"`(\w+)`", row[1]))
        if set(tasks) <= set(TASKS):
            wrong = set(places) - names if row[1].startswith("all but") else names
            refused |= dict.fromkeys(tasks, wrong)
    assert len(refused) == 7
    for task, place in itertools.product(sorted(TASKS), places):
        try:
            compose([f"+task={task}", f"playground={place}"])
        except ConfigError:
            assert place in refused.get(task, ()), (task, place)
        else:
            assert place not in refused.get(task, ()), (task, place)
