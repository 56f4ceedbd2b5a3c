"""Arithmetic of the encoders: float32, or bfloat16 where it is faster."""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from enum import Enum
from typing import TypeVar

import torch
from torch import nn

# oneDNN's convolutions with these instructions are twice as fast as in float32; without them
# bfloat16 is emulated. Other processors have bfloat16 instructions too; they were not measured.
_INSTRUCTIONS = ("avx512_bf16", "amx_bf16")


class Precision(Enum):
    """Arithmetic of an encoder that learns; parameters, heads and losses are float32.

    Copies of a policy that act compute in float32, see `for_acting`.

    Attributes:
        auto: ``bfloat16`` if the processor, and the device where that is another one, have
            instructions for it, else ``float32``. A run stores which of them it is.
        float32: Single precision.
        bfloat16: Inputs and weights of each layer are rounded to 8 significant bits; products are
            summed in single precision.
    """

    auto = "auto"
    float32 = "float32"
    bfloat16 = "bfloat16"

    def on(self, device: torch.device) -> Precision:
        """Return the arithmetic on `device`: ``float32`` or ``bfloat16``."""
        if self is not Precision.auto:
            return self
        return Precision.bfloat16 if has_bfloat16(device) else Precision.float32


def has_bfloat16(device: torch.device) -> bool:
    """Return whether the processor, and `device`, have instructions for bfloat16."""
    capabilities = torch.cpu.get_capabilities()
    if not any(capabilities.get(name, False) for name in _INSTRUCTIONS):
        return False
    return device.type != "cuda" or torch.cuda.is_bf16_supported(including_emulation=False)


class Arithmetic(nn.Module):
    """The arithmetic of an encoder; it has no parameters.

    Args:
        precision: Which it is.
    """

    def __init__(self, precision: Precision) -> None:
        super().__init__()
        self.precision = precision

    def context(self, device: torch.device) -> AbstractContextManager[object]:
        """Return the context in which the encoder computes on `device`: autocast for bfloat16."""
        if self.precision.on(device) is Precision.bfloat16:
            return torch.autocast(device.type, dtype=torch.bfloat16)
        return nullcontext()


M = TypeVar("M", bound=nn.Module)


def for_acting(policy: M) -> M:
    """Let the encoders of `policy` compute in float32, and return it.

    The few observations of a step are encoded as quickly in float32: in bfloat16 all weights are
    rounded at each call, since autocast keeps rounded ones for the backward pass alone.
    """
    for module in policy.modules():
        if isinstance(module, Arithmetic):
            module.precision = Precision.float32
    return policy
