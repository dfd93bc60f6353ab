"""Pictures and the page that shows a result, drawn from the files of a result folder.

This package reads files, or is given plain arrays; its functions are called on one rank.  It must not import dolfinx,
nor know how a solution was found.
"""
