"""Run folders, provenance, video, and what is assembled to train."""
