"""Checkpoints that other programs read, by io4dolfinx, or before dolfinx 0.10 by its predecessor adios4dolfinx."""

from __future__ import annotations

import os
from collections.abc import Sequence
from importlib import import_module
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from dolfinx import fem

from signorini_fx.errors import InstallationError, OutputError, cannot_be_written
from signorini_fx.machine import compat, parallel
from signorini_fx.mechanics.contact_points.contact_state import ContactState
from signorini_fx.mechanics.mesh.tagged import TaggedMesh
from signorini_fx.results.contact_fields import ContactFields

# The name of the tags of facets in the file, and of the attributes that tell which tag is called what.
BOUNDARIES, TAGS = "boundaries", "tag_of"
# A file that ADIOS2 writes into each folder.
_INDEX = "md.idx"


def export_checkpoint(
    file: str | Path, tagged: TaggedMesh, moments: Sequence[tuple[float, fem.Function, ContactState | None]]
) -> None:
    """The mesh with its tags of boundaries, and at each time the fields; collective.

    Args:
        file: of ADIOS2, a folder; an earlier checkpoint is overwritten.
        tagged: the mesh.
        moments: a time, the displacement, and with contact the state of the contact points of this rank.

    Raises:
        InstallationError: no library for it is installed.
        OutputError: the file cannot be written, or something else is there.
    """
    comm, library = tagged.mesh.comm, _library()
    path = Path(file)
    parallel.on_root(comm, lambda: _reserve(path))
    library.write_mesh(path, tagged.mesh)
    tagged.mesh.topology.create_entities(tagged.dimension - 1)
    library.write_meshtags(path, tagged.mesh, tagged.facet_tags, meshtag_name=BOUNDARIES)
    tags = {name: np.atleast_1d(np.asarray(tag, dtype=np.int32)) for name, tag in tagged.boundaries.items()}
    if tags:
        library.write_attributes(path, comm, TAGS, tags)
    for time, displacement, state in moments:
        library.write_function(path, displacement, time=time, name="displacement")
        if state is None:
            continue
        fields = ContactFields.on(displacement.function_space)
        fields.take(displacement.function_space, state)
        for function in (fields.pressure, fields.shear, fields.gap, fields.slip):
            library.write_function(path, function, time=time, name=function.name)


def _library() -> Any:
    """The library that this dolfinx needs.

    Raises:
        InstallationError: it is not installed.
    """
    name = compat.checkpoint_library()
    hint = f"apt install python3-{name} python3-adios2 python3-adios2-mpi, or conda install -c conda-forge {name}"
    if find_spec(name) is None:
        raise InstallationError(f"checkpoints for other programs need {name}, which is not installed: {hint}")
    # Debian's ADIOS2 otherwise takes its serial build where a single process runs, which these libraries refuse.
    os.environ.setdefault("ADIOS2_ALWAYS_USE_MPI", "1")
    try:
        return import_module(name)
    except ImportError as error:
        raise InstallationError(f"{name} cannot be imported: {error}: {hint}") from None


def _reserve(path: Path) -> None:
    """Find out whether the file can be written, before all ranks try.

    Raises:
        OutputError: see ``export_checkpoint``.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
        names = {entry.name for entry in path.iterdir()}
    except OSError as error:
        raise cannot_be_written(path, error) from None
    if names and _INDEX not in names:
        raise OutputError(f"{path}: is a folder of other files, and no checkpoint: choose another name")
