"""The report page of a result, made from the files of a result folder.

This package reads files; its functions are called on one rank.  It must not import dolfinx or
know how a solution was found.
"""
