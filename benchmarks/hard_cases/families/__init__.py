"""The families of hard cases; each module has `FAMILY` and `cases(quick)`."""

from . import closures, drift, folds, mass, redundant, repeated, singular, units

FAMILIES = {module.FAMILY: module for module in (units, drift, singular, repeated, folds, mass, redundant, closures)}
