"""What `digest.py` plays and trains, and how it hashes the results."""
