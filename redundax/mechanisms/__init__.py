"""Ready-made mechanisms, each with its parameters as arguments."""

from ._carriage import carriage as carriage
from ._countershafts import countershaft_train as countershaft_train
from ._four_bar import doubled_four_bar as doubled_four_bar
from ._n_four_bar import n_four_bar as n_four_bar
from ._parallelogram import driven_parallelogram as driven_parallelogram
from ._parallelogram import parallelogram as parallelogram
from ._parallelogram import swing as swing
from ._planetary import planetary as planetary
from ._skate import skate as skate
from ._slider_crank import slider_crank as slider_crank
from ._space._delta import delta as delta
from ._space._door import door as door
from ._space._double_cardan import double_cardan as double_cardan
from ._space._governor import governor as governor
from ._space._loops import bennett as bennett
from ._space._loops import bricard as bricard
from ._space._sarrus import sarrus as sarrus
from ._space._wheels import cart as cart
from ._space._wheels import rolling_disc as rolling_disc
from ._wojtyra2020 import wojtyra2020 as wojtyra2020
