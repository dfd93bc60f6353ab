"""The results of a solve: the solution with its certificate, the summary, and the files of a result folder.

This package evaluates and writes.  It must not change a solution, nor know which algorithm found it.
"""
