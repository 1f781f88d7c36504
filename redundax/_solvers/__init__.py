"""Solvers for load-dependent friction."""
