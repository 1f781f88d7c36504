"""Sparse matrices of large mechanisms, on the pattern of their joints; cost linear in these where they form chains,
trees and ladders."""
