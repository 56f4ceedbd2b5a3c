"""Makes the mesh of the skin, ``veca_marl/data/skin_*.csv``: a loft, fitted to the felt skin."""
