"""Names of types that several signatures share, and what reports hold."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from os import PathLike
from typing import Any, TypedDict, Union

import numpy as np
from numpy.typing import ArrayLike, NDArray

# Unions are spelled so that Python 3.10 makes them where one side is a string or None.
Path = Union[str, PathLike[str]]
Progress = Union[bool, Callable[[str, float], Any], None]
Faces = Union["NDArray[np.integer[Any]]", Sequence[Sequence[int]]]
Picture = NDArray[np.uint8]
Pose = Union[Mapping[str, float], ArrayLike]
SceneLike = Union[Mapping[str, Any], Path]
Landmarks = Union[Mapping[str, Sequence[float]], ArrayLike, Path]
MaterialLike = Union[str, Mapping[str, Union[float, str]]]


class ShapeCheck(TypedDict):
    shape: str
    over: str | None
    amplitude_mm: float
    parts_mm: float
    template_mm: float
    ratio: float | None
    direction: float | None
    wrong_side: int
    torn_edges: int
    leak_mm: float | None
    flipped: int
    area_ratios: list[float]
    lip_crossings: int
    lip_depth_mm: float
    lid_crossings: int
    lid_depth_mm: float


class CheckFinding(TypedDict):
    gate: str
    shape: str | None
    value: float
    limit: float
    vertex: int | None
    text: str


class CheckReport(TypedDict):
    passes: bool
    template: str
    skin_vertices: int
    size: float
    gates: dict[str, float]
    shapes: list[ShapeCheck]
    muscles: list[dict[str, Any]]
    distance: dict[str, float]
    regions: list[dict[str, Any]]
    findings: list[CheckFinding]
    notes: list[str]
    distances: NDArray[np.float64]
    marked: dict[str, list[int]]
