"""How wrong a solution is and what the next digit costs: error estimators and the price list.

This package judges solutions on one mesh or on several.  It must not start a solve: which mesh comes next is decided in
``solving``.
"""
