"""The training of a baseline: the joined encoders of the agents with one linear layer on top."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

import torch
from torch import Tensor, nn
from tqdm import tqdm

from veca_marl.algos.networks.encoders import for_acting
from veca_marl.algos.networks.layers import perceptron
from veca_marl.algos.networks.multisense import MultisenseCfg, Trunk
from veca_marl.datasets.baselines.inputs import NetworkInput
from veca_marl.datasets.baselines.objectives import Objective
from veca_marl.datasets.storage import StoredDataset


@dataclass
class LearningCfg:
    """Numbers of the training of a baseline.

    Attributes:
        batch: Samples of a gradient step.
        learning_rate: Of Adam at the start; it falls to 0 along half of a period of a cosine.
        test_fraction: The last samples are the test set, in (0, 1).
        hidden: Width of the hidden layer of the head; 0 for none.
    """

    batch: int = 128
    learning_rate: float = 1e-3
    test_fraction: float = 0.1
    hidden: int = 256

    def __post_init__(self) -> None:
        if self.batch < 1:
            raise ValueError(f"learning.batch must be at least 1, got {self.batch}")
        if not 0.0 < self.learning_rate < 1.0:
            raise ValueError(f"learning.learning_rate={self.learning_rate} must be in (0, 1)")
        if not 0.0 < self.test_fraction < 1.0:
            raise ValueError(f"learning.test_fraction={self.test_fraction} must be in (0, 1)")
        if self.hidden < 0:
            raise ValueError(f"learning.hidden must be 0 or more, got {self.hidden}")


class BaselineNetwork(nn.Module):
    """Encoders of the agents, joined, and a head.

    Args:
        inputs: The inputs by name.
        outputs: Length of the output.
        network: Sizes of the encoders.
        hidden: Width of the hidden layer of the head; 0 for none.
    """

    def __init__(
        self, inputs: Mapping[str, NetworkInput], outputs: int, network: MultisenseCfg, hidden: int
    ) -> None:
        super().__init__()
        self.trunk = Trunk({name: each.layout for name, each in inputs.items()}, network)
        widths = [hidden] if hidden else []
        self.head = perceptron(network.trunk_features, widths, outputs, gain=0.1)

    def forward(self, *arrays: Tensor) -> Tensor:
        """Return the outputs ``(b, outputs)``."""
        output: Tensor = self.head(self.trunk(*arrays))
        return output


@dataclass(frozen=True)
class Trained:
    """A trained network and the scores of its predictions for the test set."""

    network: BaselineNetwork
    scores: dict[str, float]


def split(n: int, test_fraction: float) -> tuple[Tensor, Tensor]:
    """Return the indices of the samples to learn from, and of the test set, which are the last."""
    test = min(max(1, round(n * test_fraction)), n - 1)
    return torch.arange(n - test), torch.arange(n - test, n)


def train_baseline(
    stored: StoredDataset,
    make_objective: type[Objective],
    inputs: Mapping[str, NetworkInput],
    network: MultisenseCfg,
    cfg: LearningCfg,
    epochs: int,
    seed: int,
    device: str,
    progress: bool = False,
) -> Trained:
    """Train one network and score it on the test set.

    Args:
        stored: The data set, of at least two samples.
        make_objective: What is learnt.
        inputs: What the network reads.
        network: Sizes of the encoders.
        cfg: Numbers of the training.
        epochs: Passes over the samples that are learnt from.
        seed: Seed of the initial parameters and of the order of the samples.
        device: Device of the network.
        progress: Whether to show a progress bar.
    """
    train, test = split(len(stored), cfg.test_fraction)
    objective = make_objective(stored, train)
    with torch.random.fork_rng():
        torch.manual_seed(seed)
        model = BaselineNetwork(inputs, objective.outputs, network, cfg.hidden).to(device)
    order = torch.Generator().manual_seed(seed)
    optimiser = torch.optim.Adam(model.parameters(), cfg.learning_rate)
    steps = epochs * -(-len(train) // cfg.batch)
    schedule = torch.optim.lr_scheduler.CosineAnnealingLR(optimiser, max(steps, 1))
    batches = _Batches(stored, objective, inputs, cfg.batch, device)
    for _ in tqdm(range(epochs), desc=f"seed {seed}", unit="epoch", disable=not progress):
        for arrays, labels in batches.of(train[torch.randperm(len(train), generator=order)]):
            loss = objective.loss(model(*arrays), labels)
            optimiser.zero_grad()
            loss.backward()
            nn.utils.clip_grad_norm_(model.parameters(), 5.0)
            optimiser.step()
            schedule.step()
    return Trained(model, _scores(model, objective, batches, test))


class _Batches:
    """Batches of inputs and labels on the device of the network."""

    def __init__(
        self,
        stored: StoredDataset,
        objective: Objective,
        inputs: Mapping[str, NetworkInput],
        size: int,
        device: str,
    ) -> None:
        self._inputs, self._size, self._device = inputs, size, device
        self._labels = {name: stored.data[name] for name in objective.labels}

    def of(self, indices: Tensor) -> Iterator[tuple[list[Tensor], dict[str, Tensor]]]:
        """Yield the batches of some samples in their order."""
        for chosen in indices.split(self._size):
            arrays = [each.array[chosen].to(self._device) for each in self._inputs.values()]
            labels = {key: value[chosen].to(self._device) for key, value in self._labels.items()}
            yield arrays, labels


@torch.no_grad()
def _scores(
    model: BaselineNetwork, objective: Objective, batches: _Batches, test: Tensor
) -> dict[str, float]:
    for_acting(model)
    outputs, labels = [], []
    for arrays, own in batches.of(test):
        outputs.append(model(*arrays))
        labels.append(own)
    joined = {key: torch.cat([each[key] for each in labels]) for key in objective.labels}
    return objective.measure(torch.cat(outputs), joined)
