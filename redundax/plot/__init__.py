"""Drawings of mechanisms, plots of results, and the pages of reports; matplotlib is imported when one is made."""

from ._band_along import band_along as band_along
from ._check import check as check
from ._draw import animate as animate
from ._draw import draw as draw
from ._draw import html as html
from ._drive import drive as drive
from ._ensemble import ensemble as ensemble
from ._solution_sets import band as band
from ._solution_sets import family as family
from ._solution_sets import spectrum as spectrum
from ._tolerance import tolerance as tolerance
from ._trajectory import trajectory as trajectory
