"""What a change of units changes: systems in other units, and the theory of Section 3 of the paper."""

from .._system._units import Units as Units
from .._system._units import ready_units as _ready_units
from ._rescaled import closure_in_units as closure_in_units
from ._rescaled import in_units as in_units
from ._rescaled import solution_from_units as solution_from_units
from ._rescaled import state_in_units as state_in_units
from ._unit_certificate import UnitCertificate as UnitCertificate
from ._unit_certificate import UnitVerdict as UnitVerdict
from ._unit_certificate import unit_certificate as unit_certificate
from ._unit_theory import dependence_in_units as dependence_in_units
from ._unit_theory import minimum_norm_parameters as minimum_norm_parameters
from ._unit_theory import minimum_norm_parameters_in_units as minimum_norm_parameters_in_units
from ._unit_theory import parametrised_multipliers as parametrised_multipliers

SI: Units
MM_TONNE: Units
MM_KG: Units
MM_KG_MS: Units
INCH_POUND: Units
FOOT_POUND: Units


def __getattr__(name: str) -> Units:
    """Units that are ready: made when asked for, since an array made at import has the precision of that moment."""
    return _ready_units(name)
