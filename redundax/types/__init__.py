"""What the calls of this package return, for annotations and `isinstance`: nobody but they builds these."""

from .._analysis._along import Change as Change
from .._analysis._along import MotionReport as MotionReport
from .._analysis._along import Narrow as Narrow
from .._analysis._release import Release as Release
from .._analysis._report import Report as Report
from .._analysis._stability import Stability as Stability
from .._analysis._verdict import Judged as Judged
from .._equations._factorisation import Factorisation as Factorisation
from .._equations._sparse_factorisation import SparseFactorisation as SparseFactorisation
from .._models._model import Model as Model
from .._models._series import BodySeries as BodySeries
from .._models._series import ReactionSeries as ReactionSeries
from .._models._series import Series as Series
from .._motion._trajectory import Trajectory as Trajectory
from .._motion._trajectory import TrajectoryStats as TrajectoryStats
from .._solution_sets._band._band import Bands as Bands
from .._solution_sets._band._band_along import BandPath as BandPath
from .._solution_sets._family._solution_family import SolutionFamily as SolutionFamily
from .._solution_sets._loads_at_rest._limit_load import LimitLoad as LimitLoad
from .._solution_sets._sticking._sticking_report import Sticking as Sticking
from .._solve._solution import Solution as Solution
from .._solve._solution import Stats as Stats
from .._study._combination import Combination as Combination
from .._study._identification import Identification as Identification
from .._study._identification import Minimum as Minimum
from .._system._decision import Decision as Decision
