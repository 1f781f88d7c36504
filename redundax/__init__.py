"""Overconstrained mechanisms in JAX: what is unique, how far the rest can vary, and what it depends on.

The examples in the docstrings go on from here:

    ```python
    import jax
    import jax.numpy as jnp
    import redundax as rx

    jax.config.update("jax_enable_x64", True)
    mechanism = rx.mechanisms.wojtyra2020(mu_rho=0.02)  # friction radius of the revolutes, m
    state = mechanism.state(phi=0.8, rate=1.0)  # crank angle, rad, and rate, rad/s
    ```
"""

from . import mechanisms as mechanisms
from . import plot as plot
from . import spatial as spatial
from . import types as types
from . import units as units
from ._analysis._along import analyze_along as analyze_along
from ._analysis._analyze import analyze as analyze
from ._analysis._grip import grip as grip
from ._analysis._stability import Settling as Settling
from ._analysis._stability import stability as stability
from ._analysis._verdict import Verdict as Verdict
from ._bodies._body import GROUND as GROUND
from ._bodies._body import Body as Body
from ._bodies._coupler import Coupler as Coupler
from ._bodies._coupler import Stop as Stop
from ._bodies._friction_model import AbstractFrictionModel as AbstractFrictionModel
from ._bodies._friction_model import ConstantFriction as ConstantFriction
from ._bodies._friction_model import Coulomb as Coulomb
from ._bodies._friction_model import Dahl as Dahl
from ._bodies._friction_model import LuGre as LuGre
from ._bodies._friction_model import RegularisedCoulomb as RegularisedCoulomb
from ._bodies._friction_model import Stribeck as Stribeck
from ._bodies._joints import AbstractFrictionalJoint as AbstractFrictionalJoint
from ._bodies._joints import AbstractJoint as AbstractJoint
from ._bodies._joints import AngleCoupling as AngleCoupling
from ._bodies._joints import AngleDriver as AngleDriver
from ._bodies._joints import Cable as Cable
from ._bodies._joints import DistanceDriver as DistanceDriver
from ._bodies._joints import Fixed as Fixed
from ._bodies._joints import GearPair as GearPair
from ._bodies._joints import KnifeEdge as KnifeEdge
from ._bodies._joints import PinInSlot as PinInSlot
from ._bodies._joints import RackAndPinion as RackAndPinion
from ._bodies._joints import Revolute as Revolute
from ._bodies._joints import Translational as Translational
from ._bodies._joints import Wheel as Wheel
from ._bodies._law_of_time import Polynomial as Polynomial
from ._bodies._loads import AbstractLoad as AbstractLoad
from ._bodies._loads import AppliedForce as AppliedForce
from ._bodies._loads import LoadFunction as LoadFunction
from ._bodies._loads import SpringDamper as SpringDamper
from ._bodies._loads import TorsionSpring as TorsionSpring
from ._bodies._mechanism import Mechanism as Mechanism
from ._bodies._pose import Motion as Motion
from ._bodies._pose import Pose as Pose
from ._bodies._pose import Wrench as Wrench
from ._bodies._speed_driver import SpeedDriver as SpeedDriver
from ._check._check import check as check
from ._closures._as_built import AsBuilt as AsBuilt
from ._closures._as_built import heated as heated
from ._closures._as_built import misfit as misfit
from ._closures._closure import AbstractClosure as AbstractClosure
from ._closures._closure import Compliance as Compliance
from ._closures._closure import MinimumNorm as MinimumNorm
from ._closures._elastic_joints import ElasticJoints as ElasticJoints
from ._closures._joint_compliance import JointCompliance as JointCompliance
from ._closures._row_scalings import RowNormalised as RowNormalised
from ._closures._row_scalings import UnitConsistent as UnitConsistent
from ._drive._along import assemble_along as assemble_along
from ._drive._drive import drive as drive
from ._drive._laws import Cycloidal as Cycloidal
from ._drive._laws import Harmonic as Harmonic
from ._drive._laws import Sampled as Sampled
from ._drive._laws import SCurve as SCurve
from ._drive._laws import Trapezoid as Trapezoid
from ._drive._peaks import with_peaks as with_peaks
from ._drive._share import LeastNorm as LeastNorm
from ._drive._share import LeastPeak as LeastPeak
from ._equations._assemble import assemble as assemble
from ._equations._factorize import factorize as factorize
from ._models._model import load_model as load_model
from ._motion._radau_solver import Radau as Radau
from ._motion._simulate import simulate as simulate
from ._motion._stabilisation import AbstractStabilisation as AbstractStabilisation
from ._motion._stabilisation import Baumgarte as Baumgarte
from ._motion._stabilisation import NoStabilisation as NoStabilisation
from ._motion._stabilisation import Projection as Projection
from ._solution_sets._band._band import band as band
from ._solution_sets._band._band_along import band_along as band_along
from ._solution_sets._bounds import AbstractBounds as AbstractBounds
from ._solution_sets._bounds import AmplitudeBox as AmplitudeBox
from ._solution_sets._bounds import ComplianceBox as ComplianceBox
from ._solution_sets._bounds import MisfitBox as MisfitBox
from ._solution_sets._bounds import PreloadBox as PreloadBox
from ._solution_sets._bounds import PreloadNorm as PreloadNorm
from ._solution_sets._family._solution_family import solution_family as solution_family
from ._solution_sets._loads_at_rest._lift_off import lift_off as lift_off
from ._solution_sets._loads_at_rest._limit_load import limit_load as limit_load
from ._solution_sets._sticking._sticking import sticking as sticking
from ._solve._all_solutions import frictional_solutions as frictional_solutions
from ._solve._solve import solve as solve
from ._solvers._continuation import Continuation as Continuation
from ._solvers._solver import AbstractSolver as AbstractSolver
from ._solvers._solver import FixedPoint as FixedPoint
from ._solvers._solver import Newton as Newton
from ._study._distributions import AbstractDistribution as AbstractDistribution
from ._study._distributions import Normal as Normal
from ._study._distributions import Uniform as Uniform
from ._study._ensemble import ensemble as ensemble
from ._study._identify import identify as identify
from ._study._study import study as study
from ._study._tolerance import tolerance_study as tolerance_study
from ._system._axis import Axis as Axis
from ._system._friction import AbstractFriction as AbstractFriction
from ._system._friction import Friction as Friction
from ._system._results import RESULTS as RESULTS
from ._system._state import State as State
from ._system._system import AbstractSystem as AbstractSystem
from ._system._system import System as System
from ._tools._cache import keep_programs as keep_programs
from ._tools._errors import NoSolutionError as NoSolutionError
from ._tools._errors import RedundaxError as RedundaxError
