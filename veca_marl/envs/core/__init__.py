"""The game core: tasks, teams, reward terms, and the game that runs them. No torch."""
