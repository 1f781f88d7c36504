"""Plots of figures over a parameter or time."""
