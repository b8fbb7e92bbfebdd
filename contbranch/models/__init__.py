"""Models: each a folder with its equations."""
