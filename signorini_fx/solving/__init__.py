"""From a scene to its solution: strategy, nested iteration, load steps, sweeps, solution to a given accuracy.

This is the only package that knows all algorithms and their order.  It is not called ``solve``, because that is the
name of the public function.
"""
