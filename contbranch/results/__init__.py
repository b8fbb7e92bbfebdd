"""What is found, as plain data: diagrams, solutions, loops, followed events, phase diagrams."""
