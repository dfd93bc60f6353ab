"""Ranks, versions, the terminal, the compiler, and text files: modules that are independent of the
problem being solved.
"""
