"""The algorithms of the paper and beyond, one update rule a module.

The inner method (``ssn``) solves one regularised problem; an outer algorithm only changes the data of that problem.
"""
