"""What a curve of equilibria means: names of folds, thresholds, Morse indices and critical exponents."""
