"""Two tasks, a sense, a network and an algorithm, written from the guides of veca_marl."""

from veca_marl_guided import compared_ears, lead_by_voice, reinforce, warmth

__all__ = ["compared_ears", "lead_by_voice", "reinforce", "warmth"]
