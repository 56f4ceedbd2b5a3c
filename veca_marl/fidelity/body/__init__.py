"""Laws of joint-level bodies: momentum, energy, joint limits."""
