"""Bodies: a skeleton, how it is moved, its voice and its proprioception."""
