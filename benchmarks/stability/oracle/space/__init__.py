"""The oracle in 3D: elements, bodies, conditions, cone programmes and statics in three dimensions.

The modules correspond to those of the plane, which they take quadrature rules, verdicts and answers from.
"""
