"""Policies with hidden state: the state that environments carry, and a gated recurrent unit."""

from veca_marl.algos.networks.memory.hidden_state import (
    memory_of,
    memory_primer,
    memory_size,
    with_memory,
    with_transform,
)

__all__ = ["memory_of", "memory_primer", "memory_size", "with_memory", "with_transform"]
