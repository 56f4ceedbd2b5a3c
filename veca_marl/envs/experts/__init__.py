"""Hand-written players of the joint-level tasks: more than a task file should hold."""
