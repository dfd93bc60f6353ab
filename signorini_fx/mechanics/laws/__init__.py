"""The friction laws: the bound of the shear as a function of the contact pressure.

``protocol`` documents what a law says; no law knows who asks it: neither points nor forms nor
scenes.
"""
