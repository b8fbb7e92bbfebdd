"""Linear and nonlinear algorithms that know an equilibrium problem only by its operators."""
