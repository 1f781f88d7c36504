"""What a change of units changes: systems in other units, and the theory of Section 3 of the paper."""

from .._system._units import Units as Units
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
