"""Expert of KickTheBall."""
