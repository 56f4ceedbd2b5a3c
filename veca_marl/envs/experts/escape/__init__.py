"""Expert of BabyzumasRevenge."""
