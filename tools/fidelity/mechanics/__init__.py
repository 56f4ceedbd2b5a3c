"""Laws of rigid bodies: fall, friction, collisions, inertia, momentum, joint limits."""
