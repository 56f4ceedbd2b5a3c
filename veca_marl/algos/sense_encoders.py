"""Encoders of single senses inside a network: found by name, copied, frozen."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from torch import nn

# attributes of encoders that are not among the parameters, and how a message calls them
_BESIDE_PARAMETERS = {
    "shape": "its input is",
    "strides": "its strides are",
    "scale": "its scale is",
}


class SenseEncoders(nn.ModuleDict):
    """Encoder modules by the name of their sense.

    A network keeps its encoders in one of these, so that `sense_encoders` finds them.
    """


def sense_encoders(network: nn.Module) -> dict[str, list[nn.Module]]:
    """Return the encoders inside `network` by sense: several where agents have their own."""
    found: dict[str, list[nn.Module]] = {}
    for part in network.modules():
        if isinstance(part, SenseEncoders):
            for sense, encoder in part.items():
                found.setdefault(sense, []).append(encoder)
    return found


def encoders_of(network: nn.Module, senses: Iterable[str], asked_by: str) -> list[nn.Module]:
    """Return the encoders of some senses.

    Args:
        network: See `sense_encoders`.
        senses: Names of senses.
        asked_by: What named them; the error message begins with it.

    Raises:
        ValueError: If there is no encoder of a sense; the message lists the choices.
    """
    found = sense_encoders(network)
    missing = sorted(set(senses) - set(found))
    if missing:
        choices = ", ".join(sorted(found)) or "none"
        raise ValueError(f"{asked_by}: no encoder of {', '.join(missing)}; choices: {choices}")
    return [encoder for sense in senses for encoder in found[sense]]


def copy_encoders(network: nn.Module, encoders: Mapping[str, Sequence[nn.Module]]) -> None:
    """Copy the parameters of encoders into those of `network`.

    Args:
        network: See `sense_encoders`.
        encoders: Sense to one module, which is copied to all agents that have encoders of their
            own, or to as many modules as `network` has.

    Raises:
        ValueError: If there is no encoder of a sense, or one does not fit.
    """
    for sense, sources in encoders.items():
        targets = encoders_of(network, [sense], "init_encoders")
        if len(sources) not in (1, len(targets)):
            raise ValueError(
                f"encoder of {sense}: one for each of {len(sources)} agents in the stored run, "
                f"for {len(targets)} in this one"
            )
        for i, target in enumerate(targets):
            try:
                _check_same_input(target, sources[i % len(sources)])
                copy_parameters(target, sources[i % len(sources)])
            except ValueError as error:
                raise ValueError(f"encoder of {sense}: {error}") from error


def _check_same_input(target: nn.Module, source: nn.Module) -> None:
    """Check that equal parameters of two encoders are the same function of the sense.

    Raises:
        ValueError: If not: shape or range of the sense, what compresses it, or strides differ.
    """
    for attribute, words in _BESIDE_PARAMETERS.items():
        new, stored = (getattr(module, attribute, None) for module in (target, source))
        if new != stored:
            old_name, name = (getattr(v, "__name__", str(v)) for v in (stored, new))
            raise ValueError(f"{words} {old_name} in the stored run, {name} in this one")


def copy_parameters(target: nn.Module, source: nn.Module) -> None:
    """Copy parameters and buffers of `source` to `target`, a module of the same structure.

    Raises:
        ValueError: If names or shapes differ; the message names the first that does.
    """
    new, stored = target.state_dict(), source.state_dict()
    for name in sorted({*new, *stored}):
        shape, stored_shape = _shape(new, name), _shape(stored, name)
        if shape != stored_shape:
            raise ValueError(f"{name} is {stored_shape} in the stored run, {shape} in this one")
    target.load_state_dict(stored)


def _shape(state: Mapping[str, object], name: str) -> str:
    return str(tuple(getattr(state[name], "shape", ()))) if name in state else "absent"
