"""Ranks, versions, the terminal, the compiler, and files in text: modules that do not know what is
solved.
"""
