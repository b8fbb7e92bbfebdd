"""What every curve of contact equilibria needs, whatever the model."""
