"""The effects (loads, supports, contact, materials): the keys of each, its form, and its error
messages.

``scenes.scene.Scene`` collects their keys.  A file here imports ``ufl`` within methods only, and
uses no mesh, matrix or result: ``loads.load_vectors`` integrates densities to load vectors.
"""
