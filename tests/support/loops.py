"""What the loops of a model from a file hold, by its tree of joints."""

import numpy as np

from redundax._models._formats import describe
from redundax._models._tree import Tree


def figures(path):
    """Redundancy and freedom of the loops at the position of the file, and how far it is from closed."""
    tree = Tree(describe(path))
    slopes = tree.system(tree.reference)[1]
    rank = int(np.linalg.matrix_rank(slopes, tol=1e-9))
    return len(slopes) - rank, tree.nv - rank, tree.misfit(tree.reference)
