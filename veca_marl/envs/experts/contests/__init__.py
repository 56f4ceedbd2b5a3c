"""Experts of the games between players: PushOut in a ring, Soccer on a pitch."""
