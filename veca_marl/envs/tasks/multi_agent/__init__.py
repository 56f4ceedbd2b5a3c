"""Tasks of several agents: navigation, ring, soccer."""
