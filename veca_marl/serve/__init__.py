"""The command that serves worlds to other machines."""
