"""Tasks that need several senses: KickTheBall."""
