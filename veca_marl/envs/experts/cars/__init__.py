"""Experts of the tasks with a toy car: DodgeCar, ChaseCar."""
