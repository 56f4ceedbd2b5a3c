"""Learning: knows specs and teams, never a task, never the simulator."""
