"""Run folders, provenance, recordings and videos."""
