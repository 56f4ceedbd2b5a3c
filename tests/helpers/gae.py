"""Generalised advantage estimates, one step at a time."""

import torch


def gae_by_hand(value, following, reward, done, terminated, gamma=0.99, lmbda=0.95):
    """Schulman et al. 2016, equation 16, one step at a time from the end."""
    advantage = torch.zeros_like(value)
    ahead = torch.zeros_like(value[:, 0])
    for t in reversed(range(value.shape[1])):
        delta = reward[:, t] + gamma * following[:, t] * ~terminated[:, t] - value[:, t]
        ahead = delta + gamma * lmbda * ~done[:, t] * ahead
        advantage[:, t] = ahead
    return advantage
