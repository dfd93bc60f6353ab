"""Prescribed displacements as Dirichlet conditions."""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from dolfinx import default_scalar_type, fem
from dolfinx import mesh as dmesh

from signorini_fx import parallel
from signorini_fx.body.assembly import facet_entities, facet_vertices
from signorini_fx.body.contact_boundary import ContactBoundary
from signorini_fx.errors import SceneError
from signorini_fx.mesh.tagged import TaggedMesh
from signorini_fx.scene.expressions import sample
from signorini_fx.scene.model import PrescribedDisplacement, Scene


def dirichlet_conditions(
    scene: Scene, space: fem.FunctionSpace, facets: dict[str, npt.NDArray[np.int32]], tagged: TaggedMesh
) -> list[tuple[PrescribedDisplacement, fem.DirichletBC]]:
    """Dirichlet conditions, one per component; where two meet the later one applies."""
    dim = space.mesh.topology.dim - 1
    supports = []
    for index, effect in enumerate(scene.displacement):
        for component, value in components(effect, index, tagged):
            subspace = space.sub(component)
            if isinstance(value, float):
                dofs = fem.locate_dofs_topological(subspace, dim, facets[effect.boundary])
                support = fem.dirichletbc(default_scalar_type(value), dofs, subspace)
            else:
                collapsed, _ = subspace.collapse()
                pair = fem.locate_dofs_topological((subspace, collapsed), dim, facets[effect.boundary])
                function = fem.Function(collapsed)
                function.interpolate(lambda x, value=value: sample(value, x))
                support = fem.dirichletbc(function, pair, subspace)
            supports.append((effect, support))
    return supports


def components(effect: PrescribedDisplacement, index: int, tagged: TaggedMesh) -> list[tuple[int, Any]]:
    """(component, value) of each prescribed component of a displacement effect."""
    if effect.normal is None:
        return [(k, value) for k, value in enumerate(effect.components) if value is not None]
    axis, sign = _axis(effect, index, tagged)
    value = effect.normal
    return [(axis, sign * value if isinstance(value, float) else lambda x: sign * sample(value, x))]


def _axis(effect: PrescribedDisplacement, index: int, tagged: TaggedMesh) -> tuple[int, float]:
    """Axis and sign of the outward normal of a flat boundary perpendicular to an axis."""
    mesh = tagged.mesh
    facets = tagged.facets(effect.boundary)
    dim = mesh.topology.dim
    low, high = parallel.global_bounds(mesh.comm, facet_vertices(mesh, facets)[:, :, :dim].reshape(-1, dim))
    inside = dmesh.compute_midpoints(mesh, dim, facet_entities(mesh, facets)[:, 0])
    outward = parallel.global_sum(mesh.comm, (dmesh.compute_midpoints(mesh, dim - 1, facets) - inside).sum(axis=0))
    flat = np.flatnonzero(high - low <= 1e-9 * tagged.size)
    if flat.size != 1:
        message = f"boundary {effect.boundary!r} is not straight along an axis: use bilateral contact without friction"
        raise SceneError([(f"displacement[{index}].normal", message)])
    return int(flat[0]), float(np.sign(outward[flat[0]]))


def fixed_dofs(space: fem.FunctionSpace, supports: list[fem.DirichletBC]) -> npt.NDArray[np.bool_]:
    """Which dofs of this rank are prescribed, shape (owned dofs,)."""
    fixed = np.zeros(space.dofmap.index_map.size_local * space.dofmap.index_map_bs, dtype=bool)
    for support in supports:
        dofs, owned = support.dof_indices()
        fixed[dofs[:owned]] = True
    return fixed


def check_overlap(
    scene: Scene, boundary: ContactBoundary, facets: dict[str, npt.NDArray[np.int32]], tagged: TaggedMesh
) -> None:
    """Refuse a prescribed normal displacement on contact facets, where it contradicts the contact condition."""
    problems = []
    for index, support in enumerate(scene.displacement):
        prescribed = np.zeros(tagged.dimension, dtype=bool)
        prescribed[[component for component, _ in components(support, index, tagged)]] = True
        for part, effect in enumerate(scene.contact):
            shared = np.intersect1d(facets[support.boundary], facets[effect.boundary]).size
            total = int(parallel.global_sum(boundary.comm, np.array(shared)))
            slope = np.abs(boundary.normal[boundary.part == part][:, prescribed]).max(initial=0.0)
            if total and parallel.global_max(boundary.comm, slope) > 1e-8:
                problems.append(
                    (
                        f"displacement[{index}]",
                        f"boundary {support.boundary!r} prescribes the normal displacement on {total} facets of the "
                        f"contact boundary {effect.boundary!r}: remove them from one of the two",
                    )
                )
    if problems:
        raise SceneError(problems)
