"""Policies in the form in which they act: without gradients, on the few observations of a step."""
