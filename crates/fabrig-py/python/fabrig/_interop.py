"""Meshes of other packages, which are imported only when they are asked for."""

from __future__ import annotations

import importlib
import os
from collections.abc import Sequence
from typing import Any

import numpy as np

from ._fabrig import InputError, Mesh, Rig, read_mesh


def _needed(module: str, package: str | None = None) -> Any:
    """A module of another package, whose extra has the module's name."""
    package = package or module
    try:
        return importlib.import_module(module)
    except ImportError as error:
        raise ImportError(
            f"this needs {package}: pip install 'fabrig[{module}]', or pip install {package}"
        ) from error


def as_mesh(source: Any) -> Mesh:
    """What `Mesh.of` does with anything that is no `Mesh`."""
    if isinstance(source, (str, os.PathLike)):
        return read_mesh(source)
    if isinstance(source, Rig):
        return source.mesh
    if isinstance(source, Sequence) and len(source) == 2:
        return Mesh(*source)
    if hasattr(source, "vertices") and hasattr(source, "faces"):
        return _of_trimesh(source)
    if hasattr(source, "points") and hasattr(source, "cells_dict"):
        return _of_meshio(source)
    if hasattr(source, "points") and hasattr(source, "extract_surface"):
        return _of_pyvista(source)
    raise InputError(
        "mesh: expected a Mesh, the path of a file, a pair (vertices, faces), or a mesh of "
        f"trimesh, meshio or pyvista, got {type(source).__name__}"
    )


def _of_trimesh(source: Any) -> Mesh:
    faces = np.asarray(source.faces)
    uv = getattr(getattr(source, "visual", None), "uv", None)
    uvs = None if uv is None or len(uv) == 0 else (np.asarray(uv), faces.ravel())
    return Mesh(np.asarray(source.vertices, float), faces, uvs=uvs)


def _of_meshio(source: Any) -> Mesh:
    points = np.asarray(source.points, float)
    if points.ndim == 2 and points.shape[1] == 2:
        points = np.column_stack([points, np.zeros(len(points))])
    faces: list[list[int]] = []
    for block in source.cells:
        if block.type in ("triangle", "quad", "polygon"):
            faces.extend(np.asarray(face).tolist() for face in block.data)
    if not faces:
        kinds = ", ".join(sorted({block.type for block in source.cells})) or "none"
        raise InputError(f"mesh: meshio's mesh has no triangles, quads or polygons, only {kinds}")
    return Mesh(points, faces)


def _of_pyvista(source: Any) -> Mesh:
    is_surface = isinstance(source, _needed("pyvista").PolyData)
    surface = source if is_surface else source.extract_surface()
    flat, faces, at = np.asarray(surface.faces), [], 0
    while at < len(flat):
        count = int(flat[at])
        faces.append(flat[at + 1 : at + 1 + count].tolist())
        at += 1 + count
    return Mesh(np.asarray(surface.points, float), faces)


def to_trimesh(mesh: Mesh) -> Any:
    trimesh = _needed("trimesh")
    # Merging vertices would change their order.
    return trimesh.Trimesh(vertices=mesh.vertices, faces=mesh.triangles, process=False)


def to_meshio(mesh: Mesh) -> Any:
    meshio = _needed("meshio")
    by_size: dict[int, list[list[int]]] = {}
    for face in mesh.faces:
        by_size.setdefault(len(face), []).append(face)
    names = {3: "triangle", 4: "quad"}
    cells = [(names.get(size, "polygon"), np.array(faces)) for size, faces in sorted(by_size.items())]
    return meshio.Mesh(mesh.vertices, cells)


def to_pyvista(mesh: Mesh) -> Any:
    pyvista = _needed("pyvista")
    counts, corners = mesh.polygons
    starts = np.concatenate([[0], np.cumsum(counts)[:-1]]).astype(np.int64)
    flat = np.insert(corners.astype(np.int64), starts, counts)
    return pyvista.PolyData(mesh.vertices, flat)


def plot(mesh: Mesh, scalars: Any = None, **options: Any) -> Any:
    surface = to_pyvista(mesh)
    options.setdefault("smooth_shading", True)
    if scalars is not None:
        scalars = np.asarray(scalars)
        if scalars.shape != (len(mesh),):
            raise InputError(f"scalars: expected shape ({len(mesh)},), got {scalars.shape}")
        options["scalars"] = scalars
    else:
        options.setdefault("color", (224, 172, 147))
    return surface.plot(**options)
