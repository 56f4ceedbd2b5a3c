"""The card of a data set for people: README.md with plots, sample pictures and sounds."""

from __future__ import annotations

import wave
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from veca_marl.algos.files import write_atomically, write_errors
from veca_marl.datasets.fields import Field, Role
from veca_marl.datasets.storage import StoredDataset
from veca_marl.sim.sound import SAMPLE_RATE_HZ

README, PICTURES, SOUNDS = "README.md", "pictures", "sounds"
_SHOWN = 16  # samples in a picture
_HEARD = 4  # samples with a sound
_COUNTED = 20_000  # samples at most in a plot of a distribution
_DRAWN_MS = 30  # milliseconds of a waveform
_PEAK = 0.9  # of full scale, in sounds


def illustrate(stored: StoredDataset) -> None:
    """Write the README of a data set, its pictures and its sounds into its folder.

    Without matplotlib there are no pictures, and the README says so.

    Raises:
        WriteError: If a file cannot be written.
    """
    figures = write_pictures(stored) if find_spec("matplotlib") is not None else {}
    sounds = write_sounds(stored)
    write_atomically(stored.folder / README, readme(stored, figures, sounds))


def readme(stored: StoredDataset, figures: dict[str, str], sounds: list[str]) -> str:
    """Return the text of the README.

    Args:
        stored: The data set.
        figures: Title of each picture by its path.
        sounds: Paths of the sounds.
    """
    plan, card = stored.plan, stored.card
    lines = [
        f"# {plan.name}",
        "",
        str(card["description"]),
        "",
        f"{plan.n} samples, seed {plan.seed}, {plan.n_bytes / 1e6:,.1f} MB. Made by",
        "",
        f"    {card['command']}",
        "",
        f"SHA-256 of the checksums of all blocks: `{card['checksum']}`. Versions: "
        + ", ".join(f"{name} {number}" for name, number in card["versions"].items())
        + f", veca_marl {plan.version}.",
        "",
        "```python",
        "from veca_marl.datasets import load",
        "",
        f'data = load("{stored.folder.name}").data  # a TensorDict of {plan.n} samples',
        "```",
        "",
        "## Fields",
        "",
        "| field | role | type | range | found | unit | meaning |",
        "|---|---|---|---|---|---|---|",
        *[_row(stored, name, field) for name, field in plan.fields.items()],
        "",
    ]
    for name, field in plan.fields.items():
        if field.names:
            names = ", ".join(f"{i} {each}" for i, each in enumerate(field.names))
            lines += [f"`{name}`: {names}.", ""]
    if not figures:
        lines += ["Pictures need matplotlib: `pip install 'veca_marl[plot]'`.", ""]
    for path, title in figures.items():
        lines += [f"## {title}", "", f"![{title}]({path})", ""]
    if sounds:
        links = ", ".join(f"[{Path(path).stem}]({path})" for path in sounds)
        lines += [f"## Sounds of the first samples, for headphones\n\n{links}", ""]
    return "\n".join(lines)


def _row(stored: StoredDataset, name: str, field: Field) -> str:
    values = _some(stored, name)
    shape = " x ".join(map(str, field.shape)) or "scalar"
    found = f"{values.min():.4g} to {values.max():.4g}"
    return (
        f"| `{name}` | {field.role.value} | {field.dtype}, {shape} | {field.low:.4g} to "
        f"{field.high:.4g} | {found} | {field.unit} | {field.meaning} |"
    )


def _some(stored: StoredDataset, name: str) -> NDArray[Any]:
    """Return the values of a field: of the first samples, of fewer if a sample has many."""
    field = stored.plan.fields[name]
    count = max(_SHOWN, min(_COUNTED, 200_000_000 // max(field.n_bytes, 1)))
    values: NDArray[Any] = stored.data[name][:count].numpy()
    return values


# ---- sounds


def write_sounds(stored: StoredDataset) -> list[str]:
    """Write the sounds of the first samples; return their paths in the folder."""
    if "waveform" not in stored.plan.fields:
        return []
    paths = []
    for index in range(min(_HEARD, len(stored))):
        path = f"{SOUNDS}/sample_{index}.wav"
        write_wav(stored.folder / path, stored.data["waveform"][index].numpy())
        paths.append(path)
    return paths


def write_wav(path: Path, waveform: NDArray[Any]) -> None:
    """Write a waveform ``(2, n)`` as a WAV file of 16 bits, scaled to nearly full scale.

    Raises:
        WriteError: If it cannot be written.
    """
    peak = max(float(np.abs(waveform).max()), 1e-12)
    samples = np.round(waveform.T / peak * _PEAK * 32767.0).astype("<i2")
    with write_errors(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        with wave.open(str(path), "wb") as file:
            file.setnchannels(2)
            file.setsampwidth(2)
            file.setframerate(SAMPLE_RATE_HZ)
            file.writeframes(samples.tobytes())


# ---- pictures


def write_pictures(stored: StoredDataset) -> dict[str, str]:
    """Draw distributions and samples; return the title of each picture by its path."""
    pictures = {}
    for name, field in stored.plan.fields.items():
        if field.role is not Role.input:
            path = f"{PICTURES}/distribution_{name}.png"
            _save(_distribution(name, field, _some(stored, name)), stored.folder / path)
            pictures[path] = f"Distribution of {name}"
    if not stored.names("input"):
        return pictures
    samples = f"{PICTURES}/samples.png"
    _save(sample_figure(stored), stored.folder / samples)
    return {samples: "Samples", **pictures}


def _save(figure: Any, path: Path) -> None:
    with write_errors(path):
        path.parent.mkdir(parents=True, exist_ok=True)
        figure.savefig(path, dpi=80)


def _figure(width: float, height: float) -> Any:
    from matplotlib.figure import Figure

    return Figure(figsize=(width, height), layout="constrained")


def _distribution(name: str, field: Field, values: NDArray[Any]) -> Any:
    """Return a figure of the distribution of a field: counts of classes, or histograms."""
    if field.dtype == "int64" and field.names:
        figure = _figure(max(4.0, 0.25 * len(field.names)), 3.2)
        axes = figure.subplots()
        axes.bar(range(len(field.names)), np.bincount(values, minlength=len(field.names)))
        axes.set_xticks(range(len(field.names)), field.names, rotation=90 * (len(field.names) > 6))
        axes.set_ylabel("samples")
        return figure
    one_each = field.names and len(field.names) <= 6 and len(field.shape) == 1
    columns = values.reshape(len(values), -1).T if one_each else values.reshape(1, -1)
    labels = field.names if one_each else (name,)
    figure = _figure(3.2 * len(columns), 2.6)
    for axes, label, column in zip(
        np.ravel(figure.subplots(1, len(columns))), labels, columns, strict=True
    ):
        axes.hist(column, bins=40)
        axes.set_xlabel(f"{label} [{field.unit}]")
    return figure


def sample_figure(stored: StoredDataset) -> Any:
    """Return a figure of the first samples with their labels."""
    inputs = stored.names("input")
    drawn = {
        "image": _draw_image,
        "vision": _draw_eyes,
        "waveform": _draw_waveform,
        "touch": _draw_readings,
        "touch_parts": _draw_readings,
    }
    count = min(_SHOWN, len(stored))
    rows = count * len(inputs)
    columns = 4
    figure = _figure(14.0, 2.6 * -(-rows // columns))
    all_axes = np.ravel(figure.subplots(-(-rows // columns), columns, squeeze=False))
    for axes in all_axes[rows:]:
        axes.axis("off")
    for place, (index, name) in enumerate((i, name) for i in range(count) for name in inputs):
        axes = all_axes[place]
        sample = {key: value.numpy() for key, value in stored.data[index].items()}
        drawn.get(name, _draw_values)(axes, sample, name)
        axes.set_title(_title(stored, sample), fontsize=8)
    return figure


def _title(stored: StoredDataset, sample: dict[str, NDArray[Any]]) -> str:
    """Return the labels of a sample in words."""
    words = []
    for name in stored.names("label"):
        field, value = stored.plan.fields[name], sample[name]
        if field.dtype == "int64":
            words.append(field.names[int(value)] if field.names else str(int(value)))
        elif value.size <= 4:
            words.append(f"{name} " + ", ".join(f"{number:.2f}" for number in value.ravel()))
    return "; ".join(words)


def _draw_image(axes: Any, sample: dict[str, NDArray[Any]], name: str) -> None:
    image = sample[name].transpose(1, 2, 0)
    axes.imshow(image)
    axes.axis("off")
    if "box" in sample:
        from matplotlib.patches import Rectangle

        x, y, h, w = sample["box"] * np.array([image.shape[1], image.shape[0]] * 2)[[0, 1, 1, 0]]
        corner = (x - w / 2 - 0.5, y - h / 2 - 0.5)
        axes.add_patch(Rectangle(corner, w, h, fill=False, edgecolor="white"))


def _draw_eyes(axes: Any, sample: dict[str, NDArray[Any]], name: str) -> None:
    """Draw the images of both eyes side by side, and a map of disparities beside them."""
    eyes = [image.transpose(1, 2, 0) / 255.0 for image in sample[name]]
    if "disparity" in sample:
        disparity = sample["disparity"]
        grey = np.kron(
            disparity / disparity.max(),
            np.ones((eyes[0].shape[0] // disparity.shape[0],) * 2),
        )
        shown = np.zeros_like(eyes[0])
        shown[: grey.shape[0], : grey.shape[1]] = grey[: shown.shape[0], : shown.shape[1], None]
        eyes.append(shown)
    axes.imshow(np.concatenate(eyes, axis=1))
    axes.axis("off")


def _draw_waveform(axes: Any, sample: dict[str, NDArray[Any]], name: str) -> None:
    samples = _DRAWN_MS * SAMPLE_RATE_HZ // 1000
    for ear, label in zip(sample[name][:, :samples], ("left", "right"), strict=True):
        axes.plot(1000.0 * np.arange(len(ear)) / SAMPLE_RATE_HZ, ear, linewidth=0.7, label=label)
    axes.legend(fontsize=6)
    axes.set_xlabel("ms", fontsize=7)
    axes.tick_params(labelsize=6)


def _draw_readings(axes: Any, sample: dict[str, NDArray[Any]], name: str) -> None:
    """Draw readings of touch over time, or those of one moment over the taxels."""
    readings = sample[name] / 255.0
    if readings.ndim == 2:
        axes.plot(readings.max(axis=1), linewidth=0.8, label="greatest reading")
        axes.plot((readings > 0.0).mean(axis=1), linewidth=0.8, label="fraction in contact")
        axes.legend(fontsize=6)
        axes.set_xlabel("step", fontsize=7)
    else:
        axes.plot(readings, linewidth=0.5)
        axes.set_xlabel("taxel", fontsize=7)
    axes.tick_params(labelsize=6)


def _draw_values(axes: Any, sample: dict[str, NDArray[Any]], name: str) -> None:
    """Draw an array of which nothing is known."""
    axes.plot(sample[name].ravel(), linewidth=0.5)
    axes.set_xlabel(name, fontsize=7)
    axes.tick_params(labelsize=6)
