"""Hand-written players of joint-level tasks, and the tools they share: no torch in them."""
