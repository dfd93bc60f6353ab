"""The algorithms of the paper and beyond, one update rule in each module.

The inner method (``ssn``) solves one regularised problem; an outer algorithm only changes the data of that problem.
This package sees nodal arrays only.  It must not know forms, meshes or kinds of linear systems.
"""
