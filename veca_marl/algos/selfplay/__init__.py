"""Self-play: pools of past policies, matchmaking, Elo ratings."""
