"""Moving on hands and knees: gaits, turning over and getting up after a fall."""
