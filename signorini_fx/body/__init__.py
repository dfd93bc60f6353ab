"""The elastic body: from a scene and its mesh to the assembled stiffness and loads, supports and rigid motions.

This is the only package that writes UFL forms.  It knows materials, loads, prescribed displacements, and the contact
boundary.  It must not know friction, active sets or how linear systems are solved.
"""
