"""Test cases of Kratos, .mdpa with parameters in JSON, and of FrontISTR, .msh with .cnt, as problems of which scenes
are made, and what a scene cannot say.

Nothing of a case is executed.  No other package imports it: an add-on.
"""
