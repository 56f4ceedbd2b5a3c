"""Whatever a file, a command line or a peer says is read, or refused in one line."""

import json
import warnings

import msgpack
import numpy as np
import pytest
import yaml
from hypothesis import example, given, settings
from hypothesis import strategies as st
from stored_runs import train_tiny

from veca_marl.config import ConfigError, compose
from veca_marl.remote.layouts import records
from veca_marl.remote.messages import (
    LARGEST_REQUEST_HEADER,
    MARK,
    Message,
    ProtocolError,
    decode,
)
from veca_marl.runs.continuation import read_progress
from veca_marl.runs.run_folder import open_run
from veca_marl.sim.hearing import SofaError, read_sofa
from veca_marl.stored_files import StoredFileError

many = settings(settings.get_profile("parsers"))

numbers = st.one_of(st.integers(), st.floats(), st.booleans(), st.none())
texts = st.text(max_size=40)
trees = st.recursive(
    st.one_of(numbers, texts),
    lambda inner: st.one_of(st.lists(inner, max_size=4), st.dictionaries(texts, inner, max_size=4)),
    max_leaves=12,
)


def in_one_line(error):
    assert str(error).strip()
    assert "\n" not in str(error)


@many
@given(st.lists(st.binary(max_size=200), max_size=4), st.booleans())
def test_frames_of_a_peer(frames, marked):
    try:
        message = decode([MARK, *frames] if marked else frames, LARGEST_REQUEST_HEADER)
    except ProtocolError as error:
        in_one_line(error)
    else:
        assert isinstance(message, Message)


plain = st.recursive(
    st.one_of(st.integers(-(2**63), 2**63), st.floats(), st.booleans(), st.none(), texts),
    lambda inner: st.one_of(st.lists(inner, max_size=4), st.dictionaries(texts, inner, max_size=4)),
    max_leaves=12,
)


@many
@given(plain, st.binary(max_size=64), st.integers(0, 2**20), st.integers(0, 255))
def test_headers_of_a_peer(content, data, position, value):
    """What msgpack packs, with a byte changed."""
    header = bytearray(msgpack.packb(content))
    header[position % len(header)] = value
    for text in (msgpack.packb(["step", 3, {"fields": content}]), bytes(header)):
        try:
            message = decode([MARK, text, data], LARGEST_REQUEST_HEADER)
        except ProtocolError as error:
            in_one_line(error)
        else:
            assert type(message.fields) is dict


@many
@given(st.binary(max_size=200), st.integers(1, 5), st.integers(0, 8))
def test_arrays_of_a_peer(data, width, worlds):
    record = np.dtype([("values", "<f4", (width,))])
    try:
        assert len(records(data, record, worlds)) == worlds
    except ProtocolError as error:
        in_one_line(error)
        assert len(data) != worlds * record.itemsize


KEYS = (
    *("task", "task.max_seconds", "body", "senses/audio", "senses.audio.n_bins", "clock"),
    *("collect.processes", "collect.engine", "algo.gamma", "experiment.arms", "seed", "plugins"),
    *("hydra.run.dir", "opponent.red", "total_frames", "playground", "log.logger", "resume"),
)
words = st.one_of(
    st.text(max_size=30),
    st.builds(
        lambda sign, key, value: f"{sign}{key}={value}",
        st.sampled_from(("", "", "+", "++", "~")),
        st.one_of(st.sampled_from(KEYS), texts),
        st.one_of(texts, trees.map(lambda tree: json.dumps(tree).replace(" ", ""))),
    ),
)


@many
@given(st.lists(words, max_size=3))
@example(["hydra.run.dir=~\0"])
@example(["+="])
@example(["task=\n"])
@example(["seed=" + "9" * 5000])
def test_words_of_a_command_line(words):
    try:
        cfg = compose(["+task=KickTheBall", *words])
    except ConfigError as error:
        in_one_line(error)
    else:
        assert cfg.task.name


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("parsers") / "run"
    return train_tiny(folder, 4, "log=csv", "log.video=false", "log.progress_bar=false")


@pytest.fixture(scope="module")
def complete(run):
    return {file.name: file.read_bytes() for file in run.iterdir() if file.is_file()}


def check_run(folder):
    """Read what evaluate and resume read first."""
    try:
        opened = open_run(folder)
        opened.typed_config()
        read_progress(folder)
    except (ConfigError, StoredFileError) as error:
        in_one_line(error)


@many
@given(data=st.data())
def test_files_of_a_run(run, complete, data):
    """A file of random content, of a random tree, with bytes changed, or of other values."""
    name = data.draw(st.sampled_from(("config.yaml", "progress.json", "provenance.json")))
    stored = complete[name]
    way = data.draw(st.sampled_from(("bytes", "tree", "changed", "value", "cut")))
    if way == "bytes":
        content = data.draw(st.binary(max_size=300))
    elif way == "tree":
        content = yaml.safe_dump(data.draw(trees), allow_unicode=False).encode()
    elif way == "changed":
        content = bytearray(stored)
        for _ in range(data.draw(st.integers(1, 5))):
            content[data.draw(st.integers(0, len(content) - 1))] = data.draw(st.integers(0, 255))
    elif way == "cut":
        content = stored[: data.draw(st.integers(0, len(stored)))]
    else:
        tree = yaml.safe_load(stored)
        owner = tree
        while True:
            key = data.draw(st.sampled_from(sorted(owner)))
            if isinstance(owner[key], dict) and owner[key] and data.draw(st.booleans()):
                owner = owner[key]
                continue
            owner[key] = data.draw(trees)
            break
        content = yaml.safe_dump(tree).encode()
    (run / name).write_bytes(bytes(content))
    try:
        check_run(run)
    finally:
        (run / name).write_bytes(stored)


@pytest.fixture(scope="module")
def sofa(tmp_path_factory):
    """What writes a file of 49 directions, and its content, which is valid."""
    h5py = pytest.importorskip("h5py")
    path = tmp_path_factory.mktemp("parsers") / "head.sofa"
    around = [[a, e, 1.4] for a in range(0, 360, 30) for e in (-30.0, 0.0, 30.0, 60.0)]
    position = np.array([*around, [0.0, 90.0, 1.4]])
    response = np.zeros((len(position), 2, 64))
    response[:, :, 8] = 1.0
    fields = {
        "Data.IR": response,
        "Data.SamplingRate": np.array([44_100.0]),
        "Data.Delay": np.zeros((1, 2)),
        "SourcePosition": position,
        "ReceiverPosition": np.array([[[0.0], [0.09], [0.0]], [[0.0], [-0.09], [0.0]]]),
    }
    named = {"Conventions": "SOFA", "SOFAConventions": "SimpleFreeFieldHRIR", "DataType": "FIR"}

    def write(fields, named, units="degree, degree, metre"):
        with h5py.File(path, "w") as file:
            for name, value in named.items():
                file.attrs[name] = np.bytes_(value)
            for name, value in fields.items():
                file[name] = value
            if "SourcePosition" in fields:
                file["SourcePosition"].attrs["Type"] = np.bytes_("spherical")
                file["SourcePosition"].attrs["Units"] = np.bytes_(units)
        return path

    return write, fields, named


def read(path):
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        try:
            head = read_sofa(path)
        except SofaError as error:
            in_one_line(error)
        else:
            assert np.isfinite(head.impulse_responses).all()


arrays = st.builds(
    lambda shape, kind, value: np.full(shape, value).astype(kind),
    st.lists(st.integers(0, 4), max_size=4).map(tuple),
    st.sampled_from(("f8", "f4", "i4", "u1", "S3")),
    st.sampled_from((0, 1, 100)),
)


@many
@given(data=st.data())
def test_fields_of_a_sofa_file(sofa, data):
    write, fields, named = sofa
    changed, stated = dict(fields), dict(named)
    key = data.draw(st.sampled_from(sorted(fields)))
    way = data.draw(st.sampled_from(("array", "absent", "values", "attribute", "units")))
    units = "degree, degree, metre"
    if way == "array":
        changed[key] = data.draw(arrays)
    elif way == "absent":
        del changed[key]
    elif way == "values":
        odd = data.draw(st.sampled_from((np.nan, np.inf, -1e300, 1e300, 0.0, 1e-300)))
        changed[key] = np.array(changed[key])
        changed[key].flat[data.draw(st.integers(0, changed[key].size - 1))] = odd
    elif way == "attribute":
        stated[data.draw(st.sampled_from(sorted(named)))] = data.draw(
            st.text(st.characters(codec="ascii", exclude_characters="\0"), max_size=20)
        )
    else:
        units = data.draw(st.text(st.characters(codec="ascii", exclude_characters="\0")))
    read(write(changed, stated, units))


@pytest.mark.parametrize("key", ["SOFAConventions", "DataType"])
def test_an_attribute_of_two_lines_is_refused_in_one(sofa, key):
    write, fields, named = sofa
    read(write(fields, named | {key: "0\n0"}))


@many
@given(data=st.data())
def test_bytes_of_a_sofa_file(sofa, data):
    write, fields, named = sofa
    path = write(fields, named)
    content = bytearray(path.read_bytes())
    for _ in range(data.draw(st.integers(1, 8))):
        content[data.draw(st.integers(0, min(len(content), 4000) - 1))] = data.draw(
            st.integers(0, 255)
        )
    path.write_bytes(bytes(content[: data.draw(st.integers(0, len(content)))] or content))
    read(path)


def test_the_files_are_readable_before_they_are_changed(sofa, run):
    write, fields, named = sofa
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        assert len(read_sofa(write(fields, named)).directions) == len(fields["SourcePosition"])
    assert open_run(run).typed_config().task.name == "KickTheBall"
