"""The friction laws: the bound of the shear as a function of the contact pressure.

A law says its bound and the derivative of that, what statics may assume, and what is not known of it.  ``protocol``
documents it, ``coulomb`` has the laws of scenes, and ``directed`` makes friction depend on the direction.

No law knows who asks it: neither points nor forms nor scenes.
"""
