"""Test cases of Kratos and FrontISTR as problems of which scenes are made, and what a scene cannot say.

They are .mdpa with parameters in JSON, and .msh with .cnt.  Nothing of a case is executed.  No other package imports
it: an add-on.
"""
