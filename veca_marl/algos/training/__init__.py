"""The training loop: stages, evaluations, budgets, times."""
