"""Rules of developmental benchmarks that are not in the VECA paper: SelfTouch, HandRegard."""
