"""Drawings of mechanisms with matplotlib, which is imported only when one is made."""

from ._animate import animate as animate
from ._draw import draw as draw
from ._html import html as html
