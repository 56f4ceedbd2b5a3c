"""The SOFA reader: files of a spherical head that the tests write, and one of the LISTEN set."""

import warnings

import numpy as np
import pytest
import scipy.signal
from paths import SHARED
from refusals import naming

from veca_marl.sim.hearing import AudioCfg, SofaError, condition, read_sofa, sofa_table
from veca_marl.sim.hearing.head_response import minimum_phase
from veca_marl.sim.hearing.hrtf import direction_vectors
from veca_marl.sim.hearing.spherical_head import ear_incidence, sphere_response, woodworth_arrival_s
from veca_marl.sim.sound import SPEED_OF_SOUND_MPS

h5py = pytest.importorskip("h5py")

LISTEN = SHARED / "data/hrtf/LISTEN_1002_IRC_1002_C_HRIR.sofa"
FILE_RATE = 44_100
RADIUS = 0.09
N_SAMPLES = 256
LATENCY_S = 1.5e-3
AZIMUTH = np.arange(0.0, 360.0, 30.0)
ELEVATION = np.arange(-30.0, 91.0, 30.0)


def sphere_fields(delays_in_field=False):
    """The content of a SOFA file of a spherical head."""
    azimuth, elevation = (a.ravel() for a in np.meshgrid(AZIMUTH, ELEVATION, indexing="ij"))
    directions = direction_vectors(np.deg2rad(AZIMUTH), np.deg2rad(ELEVATION)).reshape(-1, 3)
    incidence = ear_incidence(directions)
    frequency = np.fft.rfftfreq(1024, 1.0 / FILE_RATE)
    angles = np.linspace(0.0, np.pi, 37)
    magnitude = np.abs(sphere_response(angles, np.minimum(frequency, 12e3), RADIUS))
    table = minimum_phase(magnitude, N_SAMPLES)
    responses = table[np.rint(np.rad2deg(incidence) / 5.0).astype(int)]
    arrival = (LATENCY_S + woodworth_arrival_s(incidence, RADIUS)) * FILE_RATE
    if not delays_in_field:
        spectrum = np.fft.rfft(responses, 2 * N_SAMPLES)
        turn = np.exp(-2j * np.pi * np.arange(N_SAMPLES + 1) / (2 * N_SAMPLES) * arrival[..., None])
        responses = np.fft.irfft(spectrum * turn)[..., :N_SAMPLES]
    return {
        "Data.IR": responses,
        "Data.SamplingRate": np.array([float(FILE_RATE)]),
        "Data.Delay": arrival if delays_in_field else np.zeros((1, 2)),
        "SourcePosition": np.stack([azimuth, elevation, np.full_like(azimuth, 1.4)], axis=1),
        "ReceiverPosition": np.array([[[0.0], [0.09], [0.0]], [[0.0], [-0.09], [0.0]]]),
    }


UNITS = {"spherical": "degree, degree, metre", "cartesian": "metre"}


def write(path, fields, kind="spherical", units=None, **attributes):
    attributes = {
        "Conventions": "SOFA",
        "SOFAConventions": "SimpleFreeFieldHRIR",
        "DataType": "FIR",
        **attributes,
    }
    with h5py.File(path, "w") as file:
        for name, value in attributes.items():
            file.attrs[name] = np.bytes_(value)
        for name, value in fields.items():
            file[name] = value
        if "SourcePosition" in fields:
            stated = {"Type": kind, "Units": UNITS.get(kind, "") if units is None else units}
            file["SourcePosition"].attrs.update({k: np.bytes_(v) for k, v in stated.items() if v})
    return path


@pytest.fixture(scope="module")
def fields():
    return sphere_fields()


@pytest.fixture(scope="module")
def head(fields, tmp_path_factory):
    path = write(tmp_path_factory.mktemp("sofa") / "sphere.sofa", fields)
    return condition(read_sofa(path), 22_050)


@pytest.mark.slow
def test_a_spherical_head_is_recovered(head):
    assert head.head_radius_m == pytest.approx(RADIUS, abs=0.003)
    expected = woodworth_arrival_s(ear_incidence(head.directions), RADIUS)
    expected -= expected[np.abs(head.directions[:, 1]) < 0.15].mean()
    assert np.abs(head.arrival_s - expected).max() < 25e-6
    assert np.abs(head.filters.sum(axis=-1) - 1.0).max() < 0.15


def test_other_sampling_rates_give_the_same_responses(fields, head, tmp_path):
    fine = condition(read_sofa(write(tmp_path / "sphere.sofa", fields)), 32_000)
    assert fine.filters.shape[-1] == round(128 * 32_000 / 22_050)
    hertz = np.linspace(100.0, 9000.0, 200)
    levels = []
    for one in (head, fine):
        turn = np.exp(
            -2j * np.pi / one.sample_rate_hz * np.outer(np.arange(one.filters.shape[-1]), hertz)
        )
        levels.append(20.0 * np.log10(np.abs(one.filters @ turn)))
    assert np.sqrt(np.mean((levels[0] - levels[1]) ** 2)) < 0.3
    assert np.abs(fine.arrival_s - head.arrival_s).max() < 5e-6


def test_swapped_ears_are_detected_by_their_energy(fields, head, tmp_path):
    swapped = {**fields, "Data.IR": fields["Data.IR"][:, ::-1]}
    path = write(tmp_path / "swapped.sofa", swapped)
    with pytest.warns(UserWarning, match=naming("swapped.sofa", "ReceiverPosition")):
        found = condition(read_sofa(path), 22_050)
    assert np.array_equal(found.filters, head.filters)
    swapped["ReceiverPosition"] = -fields["ReceiverPosition"]
    found = condition(read_sofa(write(tmp_path / "honest.sofa", swapped)), 22_050)
    assert np.array_equal(found.filters, head.filters)


def test_inverted_polarity_has_no_influence(fields, head, tmp_path):
    inverted = {**fields, "Data.IR": -fields["Data.IR"]}
    found = condition(read_sofa(write(tmp_path / "inverted.sofa", inverted)), 22_050)
    assert np.allclose(found.filters, head.filters, atol=1e-6)
    assert np.allclose(found.arrival_s, head.arrival_s, atol=1e-9)


def test_the_response_of_the_loudspeaker_is_removed(fields, head, tmp_path):
    """A loudspeaker without output below 150 Hz and with a roll-off above 3 kHz."""
    mute = scipy.signal.butter(2, 150.0, "highpass", fs=FILE_RATE, output="sos")
    dull = scipy.signal.butter(1, 3000.0, "lowpass", fs=FILE_RATE, output="sos")
    coloured = scipy.signal.sosfilt(np.concatenate([mute, dull]), fields["Data.IR"])
    path = write(tmp_path / "coloured.sofa", {**fields, "Data.IR": coloured})
    found = condition(read_sofa(path), 22_050)
    hertz = np.fft.rfftfreq(1024, 1.0 / 22_050)
    heard = (hertz > 40.0) & (hertz < 8000.0)
    ratio = np.abs(np.fft.rfft(found.filters, 1024) / np.fft.rfft(head.filters, 1024))
    assert np.abs(20.0 * np.log10(ratio[..., heard])).max() < 2.0
    low = np.abs(np.fft.rfft(found.filters, 1024))[..., (hertz > 20.0) & (hertz < 120.0)]
    assert np.abs(20.0 * np.log10(low)).max() < 1.5


@pytest.mark.slow
def test_delays_in_their_own_field_are_used(head, tmp_path):
    path = write(tmp_path / "delay.sofa", sphere_fields(delays_in_field=True))
    found = condition(read_sofa(path), 22_050)
    assert np.abs(found.arrival_s - head.arrival_s).max() < 25e-6


def test_cartesian_positions_are_converted(fields, head, tmp_path):
    positions = 1.4 * direction_vectors(np.deg2rad(AZIMUTH), np.deg2rad(ELEVATION)).reshape(-1, 3)
    path = write(tmp_path / "xyz.sofa", {**fields, "SourcePosition": positions}, kind="cartesian")
    measured = read_sofa(path)
    assert np.allclose(measured.directions, head.directions, atol=1e-9)
    assert measured.distance_m == pytest.approx(1.4)


def test_a_wrong_sampling_rate_is_detected_by_the_head_radius(fields, tmp_path):
    path = write(tmp_path / "rate.sofa", fields)
    with pytest.warns(UserWarning, match=r"radius 5\.\d cm"):
        small = condition(read_sofa(path, sample_rate_hz=70_560.0), 22_050)
    assert small.head_radius_m == pytest.approx(RADIUS * FILE_RATE / 70_560.0, abs=0.002)
    with pytest.raises(SofaError, match=naming("rate.sofa", "radius")):
        condition(read_sofa(path, sample_rate_hz=176_400.0), 22_050)


def test_pulses_without_a_head_are_refused(fields, tmp_path):
    pulses = np.zeros_like(fields["Data.IR"])
    pulses[:, :, 40] = 1.0
    pulses[:, 0, 40] += 0.01 * np.sign(np.sin(np.deg2rad(fields["SourcePosition"][:, 0])))
    path = write(tmp_path / "pulses.sofa", {**fields, "Data.IR": pulses})
    with pytest.raises(SofaError, match=r"pulses\.sofa.*radius"):
        condition(read_sofa(path), 22_050)


def only(fields, directions):
    """A part of a set: the measurements for which the function of azimuth and elevation holds."""
    azimuth, elevation, _ = fields["SourcePosition"].T
    kept = directions(azimuth, elevation)
    return {
        **fields,
        "Data.IR": fields["Data.IR"][kept],
        "SourcePosition": fields["SourcePosition"][kept],
    }


def broken(fields):
    """Name, fields, attributes and what the message has to name."""
    responses, positions = fields["Data.IR"], fields["SourcePosition"]
    without = {key: value for key, value in fields.items() if key != "Data.IR"}
    return [
        ("lacks", without, {}, ("Data.IR",)),
        ("netcdf", fields, {"Conventions": "CF"}, ("attribute", "Conventions")),
        (
            "room",
            fields,
            {"SOFAConventions": "SingleRoomDRIR"},
            ("SOFAConventions", "SingleRoomDRIR"),
        ),
        ("tf", fields, {"DataType": "TF"}, ("DataType", "TF", "FIR")),
        ("mono", {**fields, "Data.IR": responses[:, :1]}, {}, ("Data.IR", responses[:, :1].shape)),
        ("nan", {**fields, "Data.IR": responses * np.nan}, {}, ("Data.IR", "finite")),
        ("mute", {**fields, "Data.IR": responses * 0.0}, {}, ("Data.IR", "zero")),
        ("few", {**fields, "Data.IR": responses[:3]}, {}, ("3 directions",)),
        ("count", {**fields, "Data.IR": responses[:-1]}, {}, ("SourcePosition", positions.shape)),
        ("slow", {**fields, "Data.SamplingRate": np.array([100.0])}, {}, ("100.0 Hz",)),
        (
            "rates",
            {**fields, "Data.SamplingRate": np.array([44.1e3, 48e3])},
            {},
            ("Data.SamplingRate", "(2,)"),
        ),
        ("delay", {**fields, "Data.Delay": np.zeros((3, 2))}, {}, ("Data.Delay", "(3, 2)")),
        ("text", {**fields, "Data.IR": "none"}, {}, ("Data.IR", "numbers")),
        ("untyped", fields, {"kind": "", "units": "degree"}, ("SourcePosition", "Type ''")),
        ("unitless", fields, {"units": ""}, ("SourcePosition", "'spherical'", "Units ''")),
        (
            "feet",
            fields,
            {"units": "degree, degree, foot"},
            ("SourcePosition", "'degree, degree, foot'"),
        ),
        (
            "colatitude",
            {**fields, "SourcePosition": positions + np.array([0.0, 90.0, 0.0])},
            {},
            ("SourcePosition", "elevations"),
        ),
        (
            "near",
            {**fields, "SourcePosition": positions * (1, 1, 0)},
            {},
            ("source", "0.00 m"),
        ),
        ("half", only(fields, lambda a, e: a < 170.0), {}, ("directions", "side")),
        (
            "frontal",
            only(fields, lambda a, e: np.cos(np.deg2rad(a)) >= -1e-9),
            {},
            ("azimuth", "elevation", "90 degrees"),
        ),
        (
            "horizontal",
            only(fields, lambda a, e: e == 0.0),
            {},
            ("azimuth", "elevation", "90 degrees"),
        ),
        ("rad", {**fields, "SourcePosition": np.deg2rad(positions)}, {}, ("source", "0.02 m")),
    ]


@pytest.mark.parametrize("case", range(22))
def test_errors_of_invalid_files_name_the_file(fields, tmp_path, case):
    name, content, attributes, parts = broken(fields)[case]
    path = write(tmp_path / f"{name}.sofa", content, **attributes)
    with pytest.raises(SofaError, match=naming(f"{name}.sofa", *parts)):
        read_sofa(path)


def test_angles_in_radians_are_converted(fields, tmp_path):
    azimuth, elevation, distance = fields["SourcePosition"].T
    positions = np.stack([np.deg2rad(azimuth), np.deg2rad(elevation), distance], axis=1)
    content = {**fields, "SourcePosition": positions}
    path = write(tmp_path / "radians.sofa", content, units="radian, radian, metre")
    found, expected = read_sofa(path), read_sofa(write(tmp_path / "degrees.sofa", fields))
    assert np.allclose(found.directions, expected.directions, atol=1e-12)


def test_positions_of_a_room_are_converted_to_the_frame_of_the_head(fields, tmp_path):
    """A head at (1, 2, 3) that lies on its back and faces up, its crown toward -x."""
    expected = read_sofa(write(tmp_path / "head.sofa", fields))
    forward, up = np.array([0.0, 0.0, 1.0]), np.array([-1.0, 0.0, 0.0])
    axes = np.stack([forward, np.cross(up, forward), up], axis=1)
    in_room = 1.4 * expected.directions @ axes.T + (1.0, 2.0, 3.0)
    listener = {"Position": [[1.0, 2.0, 3.0]], "View": [2.0 * forward], "Up": [3.0 * up]}
    # SourcePosition in the order that the reader keeps: one of each direction
    path = write(
        tmp_path / "room.sofa",
        {
            **fields,
            "Data.IR": expected.impulse_responses,
            "SourcePosition": in_room,
            **{f"Listener{key}": np.array(value) for key, value in listener.items()},
        },
        kind="cartesian",
    )
    with h5py.File(path, "a") as file:
        for key in ("ListenerPosition", "ListenerView"):
            file[key].attrs.update({"Type": "cartesian", "Units": "metre"})
    found = read_sofa(path)
    assert np.allclose(found.directions, expected.directions, atol=1e-9)
    assert found.distance_m == pytest.approx(1.4)


def test_of_several_distances_the_longest_is_used(fields, tmp_path):
    near = fields["SourcePosition"] * (1.0, 1.0, 0.2)
    content = {
        **fields,
        "Data.IR": np.concatenate([0.5 * fields["Data.IR"], fields["Data.IR"]]),
        "SourcePosition": np.concatenate([near, fields["SourcePosition"]]),
    }
    with pytest.warns(UserWarning, match=naming("both.sofa", "120", "60")):
        found = read_sofa(write(tmp_path / "both.sofa", content))
    expected = read_sofa(write(tmp_path / "far.sofa", fields))
    assert found.distance_m == pytest.approx(1.4)
    assert np.array_equal(found.impulse_responses, expected.impulse_responses)


def replaced(fields, path, key, create):
    """A valid file in which one field is created anew by a function of the open file."""
    write(path, fields)
    with h5py.File(path, "a") as file:
        del file[key]
        create(file, key)
    return path


@pytest.mark.parametrize("key", ["Data.IR", "SourcePosition", "Data.Delay", "Data.SamplingRate"])
def test_declared_sizes_that_are_not_stored_are_refused_before_allocation(fields, tmp_path, key):
    """The file declares 3 PiB and has 0.5 MB."""
    shape = (3 << 44, 2, 4) if key == "Data.IR" else (3 << 45, 4)

    def create(file, name):
        chunks = (1024, *shape[1:])
        file.create_dataset(name, shape, "f8", chunks=chunks, maxshape=(None, *shape[1:]))

    path = replaced(fields, tmp_path / "large.sofa", key, create)
    assert path.stat().st_size < 1_000_000
    with pytest.raises(SofaError, match=naming("large.sofa", key, 3 << 47)):
        read_sofa(path)


def test_a_moderate_size_that_is_not_stored_is_refused(fields, tmp_path):
    path = replaced(
        fields,
        tmp_path / "hollow.sofa",
        "Data.IR",
        lambda file, name: file.create_dataset(name, (60, 2, 65_536), "f8", chunks=(1, 2, 1024)),
    )
    with pytest.raises(
        SofaError, match=naming("hollow.sofa", "Data.IR", 60 * 2 * 65_536, "0 bytes")
    ):
        read_sofa(path)


def test_links_and_external_data_are_refused(fields, tmp_path):
    write(tmp_path / "other.sofa", fields)
    responses = fields["Data.IR"]
    (tmp_path / "raw.bin").write_bytes(responses.tobytes())

    def virtual(file, name):
        layout = h5py.VirtualLayout(responses.shape, "f8")
        layout[:] = h5py.VirtualSource(str(tmp_path / "other.sofa"), name, responses.shape)
        file.create_virtual_dataset(name, layout)

    def external(file, name):
        raw = [(str(tmp_path / "raw.bin"), 0, responses.nbytes)]
        file.create_dataset(name, responses.shape, "f8", external=raw)

    def linked(file, name):
        file[name] = h5py.ExternalLink(str(tmp_path / "other.sofa"), name)

    for create, place in ((linked, "link"), (external, "file"), (virtual, "file")):
        path = replaced(fields, tmp_path / "elsewhere.sofa", "Data.IR", create)
        with pytest.raises(SofaError, match=naming("elsewhere.sofa", "Data.IR", place)):
            read_sofa(path)


def test_missing_files_and_files_that_are_not_hdf5_are_refused(tmp_path):
    path = tmp_path / "page.sofa"
    path.write_text("<html>404</html>")
    with pytest.raises(SofaError, match=naming("page.sofa", "SOFA")):
        read_sofa(path)
    with pytest.raises(SofaError, match=naming("nowhere.sofa")):
        read_sofa(tmp_path / "nowhere.sofa")


def test_without_h5py_a_configuration_with_a_sofa_file_is_refused(monkeypatch, tmp_path):
    monkeypatch.setitem(__import__("sys").modules, "h5py", None)
    with pytest.raises(ValueError, match=naming("sofa_path=head.sofa", "veca_marl[sofa]")):
        AudioCfg(sofa_path="head.sofa")


def test_without_h5py_the_error_names_the_extra(monkeypatch, tmp_path):
    monkeypatch.setitem(__import__("sys").modules, "h5py", None)
    with pytest.raises(ImportError, match=r"veca_marl\[sofa\]"):
        read_sofa(tmp_path / "any.sofa")


def test_a_file_of_the_listen_set():
    """IRCAM's page says 44 100 Hz; the file says 48 000 and has the receivers reversed."""
    if not LISTEN.exists():
        pytest.skip("the LISTEN file is not here")
    with pytest.warns(UserWarning, match=naming(LISTEN.name, "ReceiverPosition")):
        table = sofa_table(str(LISTEN), 22_050, 44_100.0)
    assert table.head_radius_m == pytest.approx(0.085, abs=0.003)
    left = table.filters[18, 18]  # azimuth 90, elevation 0
    assert (left[0] ** 2).sum() > 4.0 * (left[1] ** 2).sum()
    lead = (table.arrival_samples[18, 18] @ (-1.0, 1.0)) / 22_050
    assert lead == pytest.approx(0.085 / SPEED_OF_SOUND_MPS * (1 + np.pi / 2), abs=80e-6)
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # cached: read once, warned once
        assert sofa_table(str(LISTEN), 22_050, 44_100.0) is table


# ---- emitters (FreeFieldHRIR, data of the type FIR-E)


def emitter_fields(fields, measurements=1):
    """The same directions as emitters of a source in the centre of the head."""
    rows = fields["Data.IR"]
    delays = np.broadcast_to(fields["Data.Delay"], rows.shape[:2])
    return {
        "Data.IR": np.stack(np.moveaxis(np.split(rows, measurements), 1, 3)),
        "Data.SamplingRate": fields["Data.SamplingRate"],
        "Data.Delay": np.stack(np.moveaxis(np.split(delays, measurements), 1, 2)),
        "SourcePosition": np.zeros((1, 3)),
        "EmitterPosition": np.stack(np.split(fields["SourcePosition"], measurements), axis=-1),
        "ReceiverPosition": fields["ReceiverPosition"],
    }


def write_emitters(path, fields, kind="spherical", units="degree, degree, metre"):
    write(path, fields, SOFAConventions="FreeFieldHRIR", DataType="FIR-E")
    with h5py.File(path, "r+") as file:
        stated = {"Type": kind, "Units": units}
        file["EmitterPosition"].attrs.update({k: np.bytes_(v) for k, v in stated.items()})
    return path


@pytest.mark.parametrize(
    ("delays_in_field", "measurements"),
    [(True, 3), pytest.param(False, 1, marks=pytest.mark.slow)],
)
def test_emitters_are_directions(delays_in_field, measurements, tmp_path):
    fields = sphere_fields(delays_in_field)
    expected = read_sofa(write(tmp_path / "plain.sofa", fields))
    emitters = emitter_fields(fields, measurements)
    found = read_sofa(write_emitters(tmp_path / "emitters.sofa", emitters))
    for name in ("impulse_responses", "directions", "delays_s", "distance_m"):
        np.testing.assert_allclose(getattr(found, name), getattr(expected, name), atol=1e-12)


def test_emitters_are_relative_to_the_source(fields, tmp_path):
    """A source that moves along with the head changes no direction."""
    emitters = emitter_fields(fields)
    emitters["ListenerPosition"] = np.array([[1.0, -2.0, 0.5]])
    emitters["SourcePosition"] = np.array([[1.0, -2.0, 0.5]])
    path = write_emitters(tmp_path / "moved.sofa", emitters)
    with h5py.File(path, "r+") as file:
        for name in ("ListenerPosition", "SourcePosition"):
            file[name].attrs.update(Type=np.bytes_("cartesian"), Units=np.bytes_("metre"))
    expected = read_sofa(write(tmp_path / "plain.sofa", fields))
    np.testing.assert_allclose(read_sofa(path).directions, expected.directions, atol=1e-12)


def test_coefficients_of_spherical_harmonics_are_refused(fields, tmp_path):
    path = write_emitters(tmp_path / "sh.sofa", emitter_fields(fields), "spherical harmonics")
    with pytest.raises(SofaError, match=naming("sh.sofa", "spherical harmonics")):
        read_sofa(path)


@pytest.mark.parametrize(
    ("convention", "data_type"), [("FreeFieldHRIR", "FIR"), ("SimpleFreeFieldHRIR", "FIR-E")]
)
def test_a_convention_has_its_own_type_of_data(fields, tmp_path, convention, data_type):
    path = write(tmp_path / "f.sofa", fields, SOFAConventions=convention, DataType=data_type)
    with pytest.raises(SofaError, match=naming("f.sofa", data_type, convention)):
        read_sofa(path)


def test_emitters_of_another_number_than_the_responses_are_refused(fields, tmp_path):
    emitters = emitter_fields(fields)
    emitters["EmitterPosition"] = emitters["EmitterPosition"][:-1]
    path = write_emitters(tmp_path / "few.sofa", emitters)
    with pytest.raises(SofaError, match=naming("few.sofa", "EmitterPosition")):
        read_sofa(path)
