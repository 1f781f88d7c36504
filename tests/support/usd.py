"""Files of USD, written anew: bodies, joints, shapes, and a parallelogram that a joint of any type closes"""

HEAD = '#usda 1.0\n(\n  metersPerUnit = {0}\n  kilogramsPerUnit = {1}\n  upAxis = "{2}"\n)\n'
TURNED = "0.7071067811865476, 0, -0.7071067811865476, 0"  # x along z


def body(name, place, turn="1, 0, 0, 0", inside=""):
    return f"""def Xform "{name}" (prepend apiSchemas = ["PhysicsRigidBodyAPI", "PhysicsMassAPI"])
{{
    double3 xformOp:translate = ({place})
    quatd xformOp:orient = ({turn})
    uniform token[] xformOpOrder = ["xformOp:translate", "xformOp:orient"]
    {inside}
}}
"""


def joint(name, kind, first="", second="", places=("0, 0, 0", "0, 0, 0"), more='token physics:axis = "Y"', schemas=""):
    ends = "".join(f"rel physics:body{k} = <{each}>\n" for k, each in enumerate((first, second)) if each)
    return f"""def {kind} "{name}" {schemas}
{{
    {ends}point3f physics:localPos0 = ({places[0]})
    point3f physics:localPos1 = ({places[1]})
    {more}
}}
"""


def weighing(length=1.0, mass=1.0):
    """2 kg at 0.1 m along x, in other units."""
    x, one, two = 0.1 / length, 0.01 / mass / length**2, 0.02 / mass / length**2
    return f"""float physics:mass = {2 / mass}
    point3f physics:centerOfMass = ({x}, 0, 0)
    float3 physics:diagonalInertia = ({two}, {one}, {two})
    quatf physics:principalAxes = (0.70710678, 0, 0, 0.70710678)"""


def locked(*free):
    names = [f"{word}{axis}" for word in ("trans", "rot") for axis in "XYZ" if f"{word}{axis}" not in free]
    schemas = ", ".join(f'"PhysicsLimitAPI:{name}"' for name in names)
    limits = "\n".join(
        f"float limit:{name}:physics:{end} = {value}" for name in names for end, value in (("low", 1), ("high", -1))
    )
    return f"(prepend apiSchemas = [{schemas}])", limits


def parallelogram(last="PhysicsRevoluteJoint", free=None, length=1.0, mass=1.0, up="Z", more="", feet=""):
    a, b = 0.2 / length, 0.4 / length
    schemas, limits = ("", 'token physics:axis = "Y"') if free is None else locked(*free)
    inside, first = weighing(length, mass), f"quatf physics:localRot0 = ({TURNED})"
    return HEAD.format(length, mass, up) + "".join(
        [
            'def PhysicsScene "scene"\n{\n vector3f physics:gravityDirection = (1, 0, 0)\n',
            f"float physics:gravityMagnitude = {9.81 / length}\n}}\n",
            body("arm", "0, 0, 0", TURNED, inside),
            body("bar", f"0, 0, {a}", inside=inside),
            body("strut", f"{b}, 0, 0", TURNED, inside),
            joint("p", "PhysicsRevoluteJoint", "", "/arm", more=f'{first}\n token physics:axis = "Y"\n{feet}'),
            joint("s", last, "/strut", "/bar", (f"{a}, 0, 0", f"{b}, 0, 0"),
                  f"{limits}\n bool physics:excludeFromArticulation = 1", schemas),
            joint("q", "PhysicsRevoluteJoint", "/arm", "/bar", (f"{a}, 0, 0", "0, 0, 0")),
            joint("r", "PhysicsRevoluteJoint", "", "/strut", (f"{b}, 0, 0", "0, 0, 0")),
            more,
        ]
    )  # fmt: skip


BOX = "(-1, -1, -1), (1, -1, -1), (1, 1, -1), (-1, 1, -1), (-1, -1, 1), (1, -1, 1), (1, 1, 1), (-1, 1, 1)"
FACES = "0, 3, 2, 1, 4, 5, 6, 7, 0, 1, 5, 4, 2, 3, 7, 6, 1, 2, 6, 5, 0, 4, 7, 3"


def shape(kind, more):
    return f"""{kind} (prepend apiSchemas = ["PhysicsCollisionAPI", "PhysicsMassAPI"])
    {{
        {more}
    }}"""
