"""Faces in Rerun, which is imported only when it is asked for."""

from __future__ import annotations

import os
from typing import Any

import numpy as np

from ._fabrig import RecordedFrame, Recording, Simulation
from ._interop import _needed

_SKIN = (224, 172, 147)
_PATCH = (170, 60, 60)


def log_to_rerun(
    source: Simulation | Recording | str | os.PathLike[str],
    entity: str = "face",
    *,
    patches: bool = False,
    timeline: str = "time",
    recording: Any = None,
) -> int:
    """Logs a face to Rerun; returns how many frames were logged.

    - `source`: a `Simulation` as it stands now, to be logged after every step while it runs; or
      a `Recording`, or the path of one, from where it stands to its end
    - `entity`: path of the face: its head moves there, `skin`, `patches/NAME` and `weights`
      stand below it (mm)
    - `patches`: log muscles and fat too
    - `timeline`: name of the time axis (s)
    - `recording`: Rerun's `RecordingStream`; the current one without it

    Needs rerun-sdk: `pip install 'fabrig[rerun]'`. Start a viewer or a file first, with
    `rerun.init("face", spawn=True)` or `rerun.save("face.rrd")`.

    >>> import rerun  # doctest: +SKIP
    >>> rerun.init("face", spawn=True)  # doctest: +SKIP
    >>> simulation = fabrig.Simulation(rig, fabrig.demo_take())  # doctest: +SKIP
    >>> for _ in range(60):  # doctest: +SKIP
    ...     simulation.step(1 / 60)
    ...     fabrig.log_to_rerun(simulation)
    """
    rr = _needed("rerun", "rerun-sdk")
    if isinstance(source, Simulation):
        _log_simulation(rr, source, entity, patches, timeline, recording)
        return 1
    frames = source if isinstance(source, Recording) else Recording(source)
    count = 0
    for frame in frames:
        _log_frame(rr, frame, entity, patches, timeline, recording)
        count += 1
    return count


def _place(rr: Any, entity: str, head: np.ndarray[Any, Any], time: float, timeline: str, recording: Any) -> None:
    rr.log(entity, rr.ViewCoordinates.RIGHT_HAND_Y_UP, static=True, recording=recording)
    rr.set_time(timeline, duration=time, recording=recording)
    turn = rr.Transform3D(translation=head[:3, 3], mat3x3=head[:3, :3])
    rr.log(entity, turn, recording=recording)


def _mesh(rr: Any, positions: Any, triangles: Any, color: tuple[int, int, int]) -> Any:
    corners = positions[triangles.astype(np.int64)]
    normals = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
    of_vertex = np.zeros((len(positions), 3))
    for corner in range(3):
        np.add.at(of_vertex, triangles[:, corner], normals)
    of_vertex /= np.maximum(np.linalg.norm(of_vertex, axis=1, keepdims=True), 1e-12)
    return rr.Mesh3D(
        vertex_positions=positions,
        triangle_indices=triangles,
        vertex_normals=of_vertex,
        albedo_factor=color,
    )


def _log_simulation(
    rr: Any, simulation: Simulation, entity: str, patches: bool, timeline: str, recording: Any
) -> None:
    rig = simulation.rig
    _place(rr, entity, simulation.head, simulation.time, timeline, recording)
    skin = _mesh(rr, simulation.skin, rig.mesh.triangles, _SKIN)
    rr.log(f"{entity}/skin", skin, recording=recording)
    names = rr.SeriesLines(names=rig.shape_names)
    rr.log(f"{entity}/weights", names, static=True, recording=recording)
    rr.log(f"{entity}/weights", rr.Scalars(simulation.weights), recording=recording)
    for name in rig.patch_names if patches else []:
        rows, columns, _ = rig.patch(name).shape
        nodes = _mesh(rr, simulation.patch(name), _grid(rows, columns), _PATCH)
        rr.log(f"{entity}/patches/{name}", nodes, recording=recording)


def _grid(rows: int, columns: int) -> np.ndarray[Any, np.dtype[np.uint32]]:
    """Triangles of a grid of nodes, row by row."""
    first = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    lower = np.stack([first, first + 1, first + columns + 1], axis=1)
    upper = np.stack([first, first + columns + 1, first + columns], axis=1)
    return np.concatenate([lower, upper]).astype(np.uint32)


def _log_frame(
    rr: Any, frame: RecordedFrame, entity: str, patches: bool, timeline: str, recording: Any
) -> None:
    _place(rr, entity, frame.head, frame.time, timeline, recording)
    surfaces, triangles = frame.surfaces, frame.triangles
    muscles = set(frame.patch_names)
    for name, positions in surfaces.items():
        if name in muscles and not patches:
            continue
        path = f"{entity}/patches/{name}" if name in muscles else f"{entity}/{name}"
        color = _PATCH if name in muscles else _SKIN
        rr.log(path, _mesh(rr, positions, triangles[name], color), recording=recording)
