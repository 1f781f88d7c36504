"""Drawings of spatial mechanisms."""
