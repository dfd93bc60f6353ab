"""The elastic body: from a scene and its mesh to the assembled stiffness and loads, supports and rigid motions.

This is the only package that writes UFL forms.  It knows materials, loads, prescribed displacements, and which part of
the surface is meant for contact.  It must not know friction, active sets or how linear systems are solved.
"""
