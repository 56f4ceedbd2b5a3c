"""Reports on experiments: runs are gathered, compared and drawn."""
