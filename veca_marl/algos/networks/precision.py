"""Arithmetic of the encoders: float32, or bfloat16 where it is faster."""

from __future__ import annotations

from contextlib import AbstractContextManager, nullcontext
from enum import Enum

import torch

# oneDNN's convolutions with these instructions are twice as fast as in float32; without them
# bfloat16 is emulated. Other processors have bfloat16 instructions too; they were not measured.
_INSTRUCTIONS = ("avx512_bf16", "amx_bf16")


class Precision(Enum):
    """Arithmetic of the encoder where it learns; parameters, heads and losses are float32.

    Policies act in float32: a few observations are as fast in it, and autocast would convert all
    weights at each step.

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


def arithmetic(precision: Precision, device: torch.device) -> AbstractContextManager[object]:
    """Return the context of an encoder: autocast where it learns in bfloat16."""
    if torch.is_grad_enabled() and precision.on(device) is Precision.bfloat16:
        return torch.autocast(device.type, dtype=torch.bfloat16)
    return nullcontext()
