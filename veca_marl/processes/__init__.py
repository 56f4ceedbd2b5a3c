"""Child processes: how they begin and end, groups that are supervised, pools that serve requests.

All processes that the package and its tools start to compute are supervised here. Commands of a
sweep are started by `veca_marl.sweeps`, which shares the rules of `children`.
"""
