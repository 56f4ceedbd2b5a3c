"""The SOFA reader: files of a spherical head that the tests write, and one of the LISTEN set."""

import warnings

import numpy as np
import pytest
import scipy.signal
from paths import SHARED

from veca_marl.sim.hearing import SofaError, condition, read_sofa, sofa, sofa_table
from veca_marl.sim.hearing.conditioning import ear_incidence
from veca_marl.sim.hearing.hrtf import direction_vectors
from veca_marl.sim.hearing.minimum_phase import minimum_phase
from veca_marl.sim.hearing.spherical_head import sphere_response, woodworth_arrival_s
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


def write(path, fields, kind="spherical", **attributes):
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
            file["SourcePosition"].attrs["Type"] = np.bytes_(kind)
    return path


@pytest.fixture(scope="module")
def fields():
    return sphere_fields()


@pytest.fixture(scope="module")
def head(fields, tmp_path_factory):
    path = write(tmp_path_factory.mktemp("sofa") / "sphere.sofa", fields)
    return condition(read_sofa(path), 22_050)


def test_a_spherical_head_is_recovered(head):
    assert head.head_radius_m == pytest.approx(RADIUS, abs=0.003)
    expected = woodworth_arrival_s(ear_incidence(head.directions), RADIUS)
    expected -= expected[np.abs(head.directions[:, 1]) < 0.15].mean()
    assert np.abs(head.arrival_s - expected).max() < 25e-6
    assert np.abs(head.filters.sum(axis=-1) - 1.0).max() < 0.15


def test_swapped_ears_are_detected_by_their_energy(fields, head, tmp_path):
    swapped = {**fields, "Data.IR": fields["Data.IR"][:, ::-1]}
    path = write(tmp_path / "swapped.sofa", swapped)
    with pytest.warns(UserWarning, match=r"swapped\.sofa: ReceiverPosition contradicts"):
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
    with pytest.raises(SofaError, match=r"rate\.sofa.*not that of a head"):
        condition(read_sofa(path, sample_rate_hz=176_400.0), 22_050)


def test_pulses_without_a_head_are_refused(fields, tmp_path):
    pulses = np.zeros_like(fields["Data.IR"])
    pulses[:, :, 40] = 1.0
    pulses[:, 0, 40] += 0.01 * np.sign(np.sin(np.deg2rad(fields["SourcePosition"][:, 0])))
    path = write(tmp_path / "pulses.sofa", {**fields, "Data.IR": pulses})
    with pytest.raises(SofaError, match=r"pulses\.sofa.*radius"):
        condition(read_sofa(path), 22_050)


def broken(fields):
    """Name, fields, attributes and the expected message."""
    responses = fields["Data.IR"]
    without = {key: value for key, value in fields.items() if key != "Data.IR"}
    one_side = np.abs(fields["SourcePosition"][:, 0] - 180.0) > 100.0
    half = {**fields, "Data.IR": responses[one_side]}
    half["SourcePosition"] = np.abs(fields["SourcePosition"][one_side]) * (0.1, 1.0, 1.0)
    return [
        ("lacks", without, {}, "lacks Data.IR"),
        ("netcdf", fields, {"Conventions": "CF"}, "SOFA"),
        ("room", fields, {"SOFAConventions": "SingleRoomDRIR"}, "SingleRoomDRIR"),
        ("tf", fields, {"DataType": "TF"}, "DataType is TF"),
        ("mono", {**fields, "Data.IR": responses[:, :1]}, {}, "Data.IR has shape"),
        ("nan", {**fields, "Data.IR": responses * np.nan}, {}, "not finite"),
        ("zero", {**fields, "Data.IR": responses * 0.0}, {}, "zero"),
        ("few", {**fields, "Data.IR": responses[:3]}, {}, "3 directions"),
        ("count", {**fields, "Data.IR": responses[:-1]}, {}, "SourcePosition has shape"),
        ("slow", {**fields, "Data.SamplingRate": np.array([100.0])}, {}, "sampling rate 100"),
        ("delay", {**fields, "Data.Delay": np.zeros((3, 2))}, {}, "Data.Delay has shape"),
        ("side", half, {}, "one side"),
        ("text", {**fields, "Data.IR": "none"}, {}, "cannot be read"),
    ]


@pytest.mark.parametrize("case", range(13))
def test_errors_of_invalid_files_name_the_file(fields, tmp_path, case):
    name, content, attributes, message = broken(fields)[case]
    path = write(tmp_path / f"{name}.sofa", content, **attributes)
    with pytest.raises(SofaError, match=rf"{name}\.sofa.*{message}"):
        read_sofa(path)


def test_missing_files_and_files_that_are_not_hdf5_are_refused(tmp_path):
    path = tmp_path / "page.sofa"
    path.write_text("<html>404</html>")
    with pytest.raises(SofaError, match=r"page\.sofa: cannot be read"):
        read_sofa(path)
    with pytest.raises(SofaError, match="no such file"):
        read_sofa(tmp_path / "nowhere.sofa")


def test_without_h5py_the_error_names_the_extra(monkeypatch, tmp_path):
    monkeypatch.setitem(__import__("sys").modules, "h5py", None)
    with pytest.raises(ImportError, match=r"veca_marl\[sofa\]"):
        sofa.read_sofa(tmp_path / "any.sofa")


def test_a_file_of_the_listen_set():
    """IRCAM's page says 44 100 Hz; the file says 48 000 and has the receivers reversed."""
    if not LISTEN.exists():
        pytest.skip("the LISTEN file is not here")
    with pytest.warns(UserWarning, match="ReceiverPosition contradicts"):
        table = sofa_table(str(LISTEN), 22_050, 44_100.0)
    assert table.head_radius_m == pytest.approx(0.085, abs=0.003)
    left = table.filters[18, 18]  # azimuth 90, elevation 0
    assert (left[0] ** 2).sum() > 4.0 * (left[1] ** 2).sum()
    lead = (table.arrival_samples[18, 18] @ (-1.0, 1.0)) / 22_050
    assert lead == pytest.approx(0.085 / SPEED_OF_SOUND_MPS * (1 + np.pi / 2), abs=80e-6)
    with warnings.catch_warnings():
        warnings.simplefilter("error")  # cached: read once, warned once
        assert sofa_table(str(LISTEN), 22_050, 44_100.0) is table
