"""Hand-written players of joint-level tasks, and the tools they share. May use sim, never torch."""
