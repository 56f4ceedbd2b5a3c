"""Vision: cameras, rasterisation, shading, optics of the eye and the sense of vision."""
