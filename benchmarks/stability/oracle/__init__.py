"""Random scenes, judged by a program that shares no code with the package (``make oracle``).

``scenes`` and its likes draw them: a scene file and usually a mesh file.  ``package`` lets
signorini_fx solve one and returns what a user gets, as plain arrays: mesh, displacement, contact
table, outcome.  Everything else uses only these arrays and the text of the scene, in 2D and in 3D:
``elements`` and ``body`` assemble the bodies anew, ``mortar`` finds the contact points between two
of them, ``conditions`` asks whether the conditions of the problem hold, ``convex`` computes the
answer a second time as a cone programme of CVXOPT, ``statics`` asks another one about outcomes that
say there is no equilibrium, and ``judge`` puts them together.  ``units`` writes a scene in units of
its own and takes the answer back.  A test holds that none of these imports the package or FEniCSx.
"""
