"""Elastic contact on square lattices with fast transforms: a periodic cell, or a cell alone in free space."""
