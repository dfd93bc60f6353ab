"""Tables that scenes of many tests have."""


def rectangle_mesh(*cells, **parameters):
    """The table of a rectangle, with the numbers of cells along x and y."""
    counts = dict(zip(("nx", "ny"), cells, strict=False))
    return {"generator": "rectangle", "parameters": counts | parameters}


def box_mesh(*cells, **parameters):
    """The table of a box, with the numbers of cells along x, y and z."""
    counts = dict(zip(("nx", "ny", "nz"), cells, strict=False))
    return {"generator": "box", "parameters": counts | parameters}


def fixed(boundary, axes="xy"):
    """The support of a boundary without displacement along these axes."""
    return {"boundary": boundary, **dict.fromkeys(axes, 0.0)}


def coulomb_friction(coefficient):
    """The table of Coulomb friction."""
    return {"law": "coulomb", "coefficient": coefficient}


def tresca_friction(bound):
    """The table of friction with a given bound."""
    return {"law": "tresca", "bound": bound}


def plane_shape(point, normal):
    """The table of a plane foundation."""
    return {"shape": "plane", "point": point, "normal": normal}


def floor():
    """The table of the foundation y = 0."""
    return plane_shape([0.0, 0.0], [0.0, 1.0])


def circle_shape(centre, radius):
    """The table of a round foundation."""
    return {"shape": "circle", "centre": centre, "radius": radius}
