"""Touch: taxels, the penetration model and the sense of touch."""
