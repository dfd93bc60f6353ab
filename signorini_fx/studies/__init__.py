"""Studies on top of the package: which method is cheapest for which accuracy, measured against a reference solution.

Nothing in the package imports this one but the command line.
"""
