"""Baselines: losses and scores against values by hand, and that a network learns."""

import json
from types import SimpleNamespace

import pytest
import torch

from veca_marl.datasets import DatasetError, load
from veca_marl.datasets.baselines.catalogue import BASELINES, PREPARE, find_baseline, network_inputs
from veca_marl.datasets.baselines.learning import LearningCfg, split, train_baseline
from veca_marl.datasets.baselines.objectives import Box, Direction, Disparity, Distance, overlap
from veca_marl.datasets.baselines.training import Score, TrainOptions, as_json, lines, run_baseline
from veca_marl.datasets.configuration import compose_dataset, make_dataset
from veca_marl.datasets.dataset import DATASETS
from veca_marl.datasets.making import make


def stored_as(**data):
    """Return what objectives read of a data set."""
    fields = {name: SimpleNamespace(shape=tuple(each.shape[1:])) for name, each in data.items()}
    return SimpleNamespace(data=data, plan=SimpleNamespace(fields=fields))


@pytest.fixture(scope="module")
def sounds(tmp_path_factory):
    """Sixty recordings."""
    words = ["+dataset=sound_localisation"]
    folder = tmp_path_factory.mktemp("sounds") / "set"
    return make(compose_dataset(words), folder, 60, 0, 1, "command", progress=False).stored


def test_every_data_set_has_a_baseline_that_reads_its_inputs():
    assert set(BASELINES) == set(DATASETS)
    for name in DATASETS:
        fields = make_dataset(compose_dataset([f"+dataset={name}"])).fields
        assert {key for key, each in fields.items() if each.role.value == "input"} <= set(PREPARE)
        assert set(BASELINES[name].objective.scores)


def test_the_overlap_of_boxes():
    one = torch.tensor([[0.5, 0.5, 0.2, 0.4], [0.5, 0.5, 0.2, 0.4]])
    other = torch.tensor([[0.5, 0.5, 0.4, 0.2], [0.1, 0.1, 0.1, 0.1]])
    assert overlap(one, one).tolist() == pytest.approx([1.0, 1.0])
    assert overlap(one, other).tolist() == pytest.approx([0.04 / 0.12, 0.0])


def test_the_scores_of_boxes():
    truth = torch.tensor([[0.5, 0.5, 0.5, 0.5], [0.25, 0.25, 0.1, 0.1]])
    output = torch.tensor([[0.0, 0.0, 0.0, 0.0], [5.0, 5.0, 0.0, 0.0]])
    scores = Box(stored_as(), torch.arange(1)).measure(output, {"box": truth})
    assert scores == {
        "IoU at least 0.5": pytest.approx(0.5),
        "mean IoU": pytest.approx(0.5, abs=1e-3),
    }


def test_the_scores_of_distances():
    distances = torch.tensor([[1.0], [4.0]])
    objective = Distance(stored_as(distance=distances), torch.arange(2))
    output = torch.zeros(2, 1)  # the geometric mean: 2
    scores = objective.measure(output, {"distance": distances})
    assert scores["mean absolute error"] == pytest.approx(1.5)
    assert scores["mean relative error"] == pytest.approx(0.75)
    assert scores["relative absolute error"] == pytest.approx(3.0 / 3.0)
    assert float(objective.loss(output, {"distance": distances})) > 0.0


def test_the_scores_of_directions():
    directions = torch.tensor([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]])
    output = torch.tensor([[2.0, 0.0, 0.0], [0.0, 0.5, 0.0], [0.0, 1.0, 0.0]])
    scores = Direction(stored_as(), torch.arange(1)).measure(output, {"direction": directions})
    assert scores["cosine similarity"] == pytest.approx(2.0 / 3.0)
    assert scores["median error"] == pytest.approx(0.0, abs=0.1)


def test_a_perfect_map_of_disparities_has_no_error():
    disparity = torch.rand(3, 2, 2) + 0.5
    objective = Disparity(stored_as(disparity=disparity), torch.arange(3))
    log = disparity.log()
    output = ((log - log.mean()) / log.std()).flatten(1)
    labels = {"disparity": disparity}
    assert float(objective.loss(output, labels)) == pytest.approx(0.0, abs=1e-6)
    scores = objective.measure(output, labels)
    assert scores["mean disparity error"] == pytest.approx(0.0, abs=1e-5)
    assert scores["depth within 25 %"] == 1.0


@pytest.mark.parametrize(("n", "fraction", "test"), [(10, 0.1, 1), (10, 0.5, 5), (2, 0.9, 1)])
def test_the_last_samples_are_the_test_set(n, fraction, test):
    learnt, tested = split(n, fraction)
    assert tested.tolist() == list(range(n - test, n))
    assert torch.cat([learnt, tested]).tolist() == list(range(n))


def test_a_network_reads_windows_of_sound_as_agents_do(sounds):
    inputs = network_inputs(sounds)
    layout = inputs["waveform"].layout
    assert layout.shape == (4, 4, 250)
    assert inputs["waveform"].array.shape == (60, 4, 4, 250)
    phases = inputs["waveform"].array[:, :, 2:]
    assert float(phases.abs().max()) <= 1.0


def test_a_network_learns_directions_of_the_samples_that_it_has_seen(sounds):
    cfg, inputs = LearningCfg(batch=16, test_fraction=0.02), network_inputs(sounds)
    learnt, _ = split(len(sounds), cfg.test_fraction)
    network = TrainOptions().network
    numbers = (Direction, inputs, network, cfg)
    trained = train_baseline(sounds, *numbers, epochs=40, seed=0, device="cpu").network
    with torch.no_grad():
        output = trained(inputs["waveform"].array[learnt])
    found = Direction(sounds, learnt).measure(
        output, {"direction": sounds.data["direction"][learnt]}
    )
    assert found["cosine similarity"] > 0.7  # of directions by chance: about 0


def test_the_same_seed_gives_the_same_scores_and_another_one_others(sounds):
    options = TrainOptions(epochs=1, runs=2, progress=False)
    one, again = (run_baseline(sounds, options) for _ in range(2))
    assert one == again
    values = one["cosine similarity"].values
    assert values[0] != values[1]


def test_scores_are_printed_beside_the_papers_and_stored_with_what_they_depend_on(sounds):
    scores = {"cosine similarity": Score((0.5, 0.7), "higher is better")}
    printed = "\n".join(lines(sounds, find_baseline(sounds), scores))
    assert "0.6000 +- 0.1414" in printed
    assert "0.80 +- 0.03" in printed
    stored = json.loads(as_json(sounds, TrainOptions(), scores, ["+dataset=sound_localisation"]))
    assert stored["scores"]["cosine similarity"]["runs"] == [0.5, 0.7]
    assert stored["data"]["checksum"] == sounds.card["checksum"]
    assert stored["data"]["senses"]["audio"]["quality"] == "hrtf"


def test_one_sample_is_too_few(tmp_path):
    words = ["+dataset=object_classification"]
    make(compose_dataset(words), tmp_path / "set", 1, 0, 1, "command", progress=False)
    with pytest.raises(DatasetError, match="at least two"):
        run_baseline(load(tmp_path / "set"), TrainOptions(epochs=1, runs=1, progress=False))


@pytest.mark.parametrize("field", ["epochs", "runs", "threads"])
def test_impossible_numbers_are_refused(field):
    with pytest.raises(ValueError, match=field):
        TrainOptions(**{field: 0})
