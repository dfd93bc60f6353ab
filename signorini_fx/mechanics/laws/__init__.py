"""The friction laws, one file each: the bound of the shear as a function of the contact pressure.

A law says its bound and the derivative of that, what statics may assume, and in words what is not known of it; its
independent check, for the certificate, stands in the same file.  ``protocol`` documents it, ``registry`` finds laws by
their names, those of other packages by the entry points ``signorini_fx.laws``; ``directed`` makes friction depend on
the direction.

No law knows who asks it: neither points nor forms nor scenes.
"""
