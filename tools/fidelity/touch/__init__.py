"""Touch: deep contact, small objects anywhere on the body, two-point resolution."""
