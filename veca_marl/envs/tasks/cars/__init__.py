"""Tasks with a toy car that drives by itself: DodgeCar, ChaseCar."""
