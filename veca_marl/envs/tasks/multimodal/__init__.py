"""Tasks that need more than one sense: KickTheBall."""
