"""The independent truth: nothing in this package imports JAX or the library under test.

`paper` is the literal NumPy reference of the mechanism of Wojtyra, Pekal, Fraczek (2020);
`exact` solves mechanisms with exact geometry to 50 digits.
"""
