"""Watch and play a game: ``python -m veca_marl.play +task=KickTheBall``."""
