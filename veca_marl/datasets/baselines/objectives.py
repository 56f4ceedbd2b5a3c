"""What a baseline predicts, its loss, and the scores of its predictions."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import ClassVar

import torch
from torch import Tensor
from torch.nn import functional

from veca_marl.datasets.storage import StoredDataset

Labels = Mapping[str, Tensor]


class Objective(ABC):
    """The outputs of a network for a data set.

    Args:
        stored: The data set.
        train: Indices ``(t,)`` of the samples that are learnt from, for scales.

    Attributes:
        outputs: Length of the network's output.
        labels: Fields that the loss reads.
        scores: Unit and direction of each score by its name, the first one is the main one.
    """

    outputs: int
    labels: tuple[str, ...]
    scores: ClassVar[dict[str, str]]

    def __init__(self, stored: StoredDataset, train: Tensor) -> None:  # noqa: B027  optional
        """Read sizes and scales; nothing by default."""

    @abstractmethod
    def loss(self, output: Tensor, labels: Labels) -> Tensor:
        """Return the scalar loss of outputs ``(b, outputs)``."""

    @abstractmethod
    def measure(self, output: Tensor, labels: Labels) -> dict[str, float]:
        """Return the scores of outputs ``(b, outputs)`` of a whole test set."""


class Classes(Objective):
    """One class among several: cross entropy, fraction of correct predictions."""

    scores: ClassVar[dict[str, str]] = {"top-1 accuracy": "fraction, higher is better"}
    label: ClassVar[str] = "kind"

    def __init__(self, stored: StoredDataset, train: Tensor) -> None:
        self.labels = (self.label,)
        self.outputs = len(stored.plan.fields[self.label].names)

    def loss(self, output: Tensor, labels: Labels) -> Tensor:
        """See `Objective`."""
        return functional.cross_entropy(output, labels[self.label])

    def measure(self, output: Tensor, labels: Labels) -> dict[str, float]:
        """See `Objective`."""
        return {"top-1 accuracy": accuracy(output, labels[self.label])}


def accuracy(output: Tensor, classes: Tensor) -> float:
    """Return the fraction of rows in which the greatest output is that of the class."""
    return float((output.argmax(-1) == classes).float().mean())


class Sounding(Classes):
    """Which of the visible toys sounds."""

    label = "sounding"


class Distance(Objective):
    """A distance: smooth L1 loss of its logarithm, so that near and far count alike."""

    outputs = 1
    labels = ("distance",)
    scores: ClassVar[dict[str, str]] = {
        "mean relative error": "|estimate - distance| / distance, lower is better",
        "mean absolute error": "m, lower is better",
        "relative absolute error": "errors over those of the mean distance, lower is better",
    }

    def __init__(self, stored: StoredDataset, train: Tensor) -> None:
        distances = stored.data["distance"][train]
        self._mean_m = float(distances.mean())
        self._log_mean = float(distances.log().mean())

    def loss(self, output: Tensor, labels: Labels) -> Tensor:
        """See `Objective`."""
        return functional.smooth_l1_loss(
            output + self._log_mean, labels["distance"].log(), beta=0.1
        )

    def measure(self, output: Tensor, labels: Labels) -> dict[str, float]:
        """See `Objective`."""
        distance = labels["distance"]
        error = ((output + self._log_mean).exp() - distance).abs()
        return {
            "mean relative error": float((error / distance).mean()),
            "mean absolute error": float(error.mean()),
            "relative absolute error": float(error.sum() / (self._mean_m - distance).abs().sum()),
        }


class Box(Objective):
    """A box ``(x, y, h, w)``: smooth L1 loss and the lost overlap."""

    outputs = 4
    labels = ("box",)
    scores: ClassVar[dict[str, str]] = {
        "IoU at least 0.5": "fraction, higher is better",
        "mean IoU": "intersection over union, higher is better",
    }

    def loss(self, output: Tensor, labels: Labels) -> Tensor:
        """See `Objective`."""
        box = output.sigmoid()
        coordinates = functional.smooth_l1_loss(box, labels["box"], beta=0.05)
        return 4.0 * coordinates + (1.0 - overlap(box, labels["box"])).mean()

    def measure(self, output: Tensor, labels: Labels) -> dict[str, float]:
        """See `Objective`."""
        shared = overlap(output.sigmoid(), labels["box"])
        return {
            "IoU at least 0.5": float((shared >= 0.5).float().mean()),
            "mean IoU": float(shared.mean()),
        }


def overlap(one: Tensor, other: Tensor) -> Tensor:
    """Return the intersection over union ``(b,)`` of boxes ``(b, 4)`` as x, y, h, w."""
    shared = torch.ones_like(one[:, 0])
    for centre, size in ((0, 3), (1, 2)):
        low = torch.maximum(*(b[:, centre] - b[:, size] / 2 for b in (one, other)))
        high = torch.minimum(*(b[:, centre] + b[:, size] / 2 for b in (one, other)))
        shared = shared * (high - low).clamp_min(0.0)
    areas = one[:, 2] * one[:, 3] + other[:, 2] * other[:, 3]
    return shared / (areas - shared).clamp_min(1e-9)


class Direction(Objective):
    """A direction: loss and main score are the cosine of the angle."""

    outputs = 3
    labels = ("direction",)
    scores: ClassVar[dict[str, str]] = {
        "cosine similarity": "cosine of the angle to the direction, higher is better",
        "median error": "degrees, lower is better",
    }

    def loss(self, output: Tensor, labels: Labels) -> Tensor:
        """See `Objective`."""
        return 1.0 - functional.cosine_similarity(output, labels["direction"]).mean()

    def measure(self, output: Tensor, labels: Labels) -> dict[str, float]:
        """See `Objective`."""
        cosine = functional.cosine_similarity(output, labels["direction"])
        angle = cosine.clamp(-1.0, 1.0).arccos().median()
        return {"cosine similarity": float(cosine.mean()), "median error": math.degrees(angle)}


class Disparity(Objective):
    """A map of disparities; depths follow from them."""

    labels = ("disparity",)
    scores: ClassVar[dict[str, str]] = {
        "mean disparity error": "pixels, lower is better",
        "mean relative depth error": "|estimate - depth| / depth, lower is better",
        "depth within 25 %": "fraction, higher is better",
    }

    def __init__(self, stored: StoredDataset, train: Tensor) -> None:
        self.outputs = math.prod(stored.plan.fields["disparity"].shape)
        disparities = stored.data["disparity"][train].log()
        self._centre, self._scale = float(disparities.mean()), float(disparities.std())

    def _estimate(self, output: Tensor) -> Tensor:
        return (self._centre + self._scale * output).clamp(-7.0, 7.0).exp()

    def loss(self, output: Tensor, labels: Labels) -> Tensor:
        """See `Objective`."""
        target = (labels["disparity"].flatten(1).log() - self._centre) / self._scale
        return functional.smooth_l1_loss(output, target, beta=0.1)

    def measure(self, output: Tensor, labels: Labels) -> dict[str, float]:
        """See `Objective`."""
        truth, estimate = labels["disparity"].flatten(1), self._estimate(output)
        ratio = truth / estimate  # of the estimated depth to the true one
        return {
            "mean disparity error": float((estimate - truth).abs().mean()),
            "mean relative depth error": float((ratio - 1.0).abs().mean()),
            "depth within 25 %": float((torch.maximum(ratio, 1.0 / ratio) < 1.25).float().mean()),
        }


_SCALE_M = 0.1  # of positions on the body


class Contact(Objective):
    """The bone that was touched, and the point of contact on the skin in the binding pose."""

    labels = ("bone", "position")
    scores: ClassVar[dict[str, str]] = {
        "median distance": "mm on the skin in the binding pose, lower is better",
        "bone top-1 accuracy": "fraction, higher is better",
        "within 20 mm": "fraction, higher is better",
    }

    def __init__(self, stored: StoredDataset, train: Tensor) -> None:
        self._bones = len(stored.plan.fields["bone"].names)
        self.outputs = self._bones + 3
        self._centre = stored.data["position"][train].mean(0)

    def loss(self, output: Tensor, labels: Labels) -> Tensor:
        """See `Objective`."""
        bones = functional.cross_entropy(output[:, : self._bones], labels["bone"])
        target = (labels["position"] - self._centre.to(output.device)) / _SCALE_M
        return bones + functional.smooth_l1_loss(output[:, self._bones :], target, beta=0.1)

    def measure(self, output: Tensor, labels: Labels) -> dict[str, float]:
        """See `Objective`."""
        estimate = _SCALE_M * output[:, self._bones :] + self._centre.to(output.device)
        away_mm = 1000.0 * (estimate - labels["position"]).norm(dim=-1)
        return {
            "median distance": float(away_mm.median()),
            "bone top-1 accuracy": accuracy(output[:, : self._bones], labels["bone"]),
            "within 20 mm": float((away_mm <= 20.0).float().mean()),
        }
