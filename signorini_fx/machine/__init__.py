"""The machine: the launcher, the requirements, the terminal and the compiler.

These modules do not know scenes, or how problems are solved.
"""
