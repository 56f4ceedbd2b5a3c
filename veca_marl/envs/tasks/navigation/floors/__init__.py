"""The floor of a playground: free cells, shortest paths, random places."""
