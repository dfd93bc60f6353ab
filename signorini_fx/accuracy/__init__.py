"""The error of a solution and the cost of reducing it: error estimators and the price list.

This package evaluates solutions on one mesh or on several.  It must not start a solve: ``solving`` decides which mesh
comes next.
"""
