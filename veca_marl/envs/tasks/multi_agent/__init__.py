"""Tasks of several agents: MultiAgentNav, PushOut and Soccer."""
