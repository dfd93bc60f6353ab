"""Command files of code_aster, .comm, as input files of Abaqus and so as scenes, and what a scene cannot say.

It is what their commands say of contact in linear elasticity.  Nothing of a command file is executed.  No other package
imports it: an add-on.
"""
