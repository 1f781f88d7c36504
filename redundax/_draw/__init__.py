"""Drawings of planar mechanisms with matplotlib, which is imported only when one is made."""

from ._draw import draw as draw
