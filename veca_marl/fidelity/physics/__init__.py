"""Laws of props: fall, friction, collisions, inertia."""
