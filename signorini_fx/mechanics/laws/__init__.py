"""The friction laws: the bound of the shear as a function of the contact pressure and perhaps the
slip.

``protocol`` documents the interface.  Laws do not depend on contact points, forms or scenes.
"""
