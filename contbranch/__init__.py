"""Continuation and bifurcation analysis of elastic contact with coexisting solutions."""
