"""The recipes that structures are drawn from: small to medium, with every kind of joint, redundancy, friction, load."""

from .structures import Recipe

R, T, PIN = "revolute", "translational", "pin"
DRY, SEAL = "coulomb", "constant"

RECIPES = {
    "open chain, doubled": Recipe(
        tree=((R, DRY), (R, None), (T, None)),
        copies=((R, None), (T, None)),
        loads=("force", "spring"),
        halved=(T, None),
    ),
    "loop, doubled pin": Recipe(
        tree=((R, None), (R, DRY), (T, None)),
        loops=((R, None),),
        copies=((R, DRY),),
        loads=("torsion",),
        halved=(R, DRY),
    ),
    "parallel cranks": Recipe(
        tree=((R, None),),
        cranks=((3, DRY),),
        loads=("force", "follower"),
        halved=(R, DRY),
    ),
    "many cranks": Recipe(
        tree=(),
        cranks=((5, DRY),),
        copies=((R, None),),
        drives=(),
        loads=("spring",),
        halved=(R, DRY),
    ),
    "parallel guides": Recipe(
        tree=((T, DRY), (T, None), (R, DRY)),
        parallels=("translational", PIN),
        copies=((T, DRY),),
        loads=("force", "spring"),
        halved=(T, DRY),
    ),
    "slots and rods": Recipe(
        tree=((PIN, DRY), (R, None), (R, SEAL)),
        loops=(("rod", None), (PIN, None)),
        copies=((PIN, DRY), ("rod", None)),
        loads=("force", "torsion"),
        halved=(PIN, DRY),
    ),
    "driven twice": Recipe(
        tree=((R, DRY), (R, None), (R, SEAL)),
        drives=("angle", "distance"),
        copies=(("angle", None), ("distance", None)),
        loads=("follower",),
        halved=("angle", None),
    ),
    "gears and frames": Recipe(
        tree=((R, DRY), (R, None), (R, None), ("fixed", None)),
        loops=(("gear", None),),
        copies=(("gear", None), ("fixed", None)),
        parallels=("fixed",),
        loads=("force", "torsion"),
        halved=("gear", None),
    ),
    "smooth": Recipe(
        tree=((R, None), (T, None), (PIN, None)),
        loops=((PIN, None), ("gear", None)),
        copies=((R, None), (PIN, None), ("gear", None)),
        drives=("angle",),
        loads=("spring", "torsion", "force"),
        halved=(PIN, None),
    ),
    "frame": Recipe(
        tree=(("fixed", None), ("fixed", None), (R, None)),
        loops=(("rod", None),),
        copies=(("fixed", None), ("rod", None)),
        parallels=("fixed",),
        loads=("force", "follower"),
        halved=("fixed", None),
    ),
    "large": Recipe(
        tree=((R, DRY), (R, None), (T, SEAL), (R, None), (PIN, None)),
        loops=((R, None),),
        cranks=((3, None),),
        copies=((R, None), (T, SEAL)),
        parallels=("translational",),
        drives=("angle",),
        loads=("spring", "force", "torsion", "follower"),
        halved=(T, SEAL),
    ),
}

# Some frictional joints are in parts that other joints lock: their rates are zero but for rounding.
RESTING = Recipe(
    tree=((R, DRY), (R, None), (T, None)), loops=((R, None),), copies=((R, None),), loads=("force", "torsion")
)
