"""Random mechanisms whose redundancy is known, and the laws that every solution of them must satisfy.

`structures` draws what is joined to what, `samples` the numbers, `equations` evaluates them by hand-written
formulas, `library` gives them to redundax, `laws` judges the answers and `digits` solves samples with 50 digits;
`space` has those in space.
"""
