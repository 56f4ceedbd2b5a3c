"""Experts of ColorSort, ShapeSort, FillFraction."""
