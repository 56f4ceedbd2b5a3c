"""Sweeps: the runs of an experiment, several at a time, each of which can be continued.

The modules import neither torch nor the simulator: Hydra loads them with every application in the
environment, see `hydra_plugins.veca_marl_sweeps`.
"""
