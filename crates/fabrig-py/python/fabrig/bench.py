"""Measurements of `fabrig bench`, as plain values.

Every function returns what the command prints with `--json`. They take from seconds to hours:
small settings first. `progress` is True for a bar, or a function of (what, share); Ctrl-C stops.

>>> import fabrig.bench
>>> rows = fabrig.bench.registration("warp", count=1)
>>> rows[0]["failures"]
[]
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from os import PathLike
from typing import Any

from . import _fabrig
from ._fabrig import Clip, Mesh, Rig, Template, demo_take
from ._types import Path, Progress

__all__ = [
    "chain",
    "pareto",
    "registration",
    "registration_cost",
    "runtime",
    "stability",
    "table3",
]


def chain(*, cloth: bool = False) -> list[dict[str, Any]]:
    """What the whole chain loses: the template rigged as a user's face, shape by shape (mm).

    - `cloth`: let the cloth settle on each shape instead of placing the patches

    >>> max(row["moved"]["mean"] for row in fabrig.bench.chain()) < 0.5
    True
    """
    return _fabrig.bench_chain(cloth)


def registration(
    filter: str = "", *, count: int | None = None, progress: Progress = None
) -> list[dict[str, Any]]:
    """How well faces of known truth are registered: a row a case (mm).

    - `filter`: only cases whose name has this in it
    - `count`: only the first so many of them

    >>> fabrig.bench.registration("warp", count=1)[0]["failures"]
    []
    """
    return _fabrig.bench_registration(filter, count, progress)


def registration_cost(
    *, largest: int = 70_000, progress: Progress = None
) -> list[dict[str, Any]]:
    """Time from file to rig against size, stage by stage (s): a row a size.

    - `largest`: number of vertices of the largest mesh

    >>> rows = fabrig.bench.registration_cost(largest=1000)
    >>> rows[0]["seconds"] > 0
    True
    """
    return _fabrig.bench_registration_cost(largest, progress)


def pareto(
    rig: Rig | None = None,
    clip: Clip | None = None,
    *,
    ratio: float | None = None,
    frames: int | None = 90,
    substeps: Sequence[int] | None = None,
    reference_substeps: int = 128,
    full: bool = False,
    progress: Progress = None,
) -> dict[str, Any]:
    """The cloth solver's time beside its error, setting by setting.

    - `rig`, `clip`: what is simulated; the bundled face and take by default
    - `ratio`: instead of a face, the standard patch with this ratio of stretch to magnet
      stiffness
    - `frames`: of the clip the so many in which it moves most; None for all of it
    - `substeps`: only settings with so many substeps
    - `reference_substeps`: of the reference in double precision that errors are taken from
    - `full`: every setting

    Points have `family`, `substeps`, `median_ms`, `least_ms` and `error`, with `relative`.

    >>> report = fabrig.bench.pareto(ratio=30, frames=5, substeps=[8], reference_substeps=64)
    >>> report["points"][0]["error"]["relative"] < 0.1
    True
    """
    taken = demo_take() if clip is None else clip
    return _fabrig.bench_pareto(
        rig,
        taken,
        ratio,
        frames,
        None if substeps is None else list(substeps),
        reference_substeps,
        full,
        progress,
    )


def runtime(
    rig: Rig | None = None,
    clip: Clip | None = None,
    *,
    frames: int = 120,
    progress: Progress = None,
) -> dict[str, Any]:
    """What a frame costs: with and without contact, skin and recording, and by size (ms).

    - `rig`, `clip`: what is simulated; the bundled face and take by default
    - `frames`: frames of each measurement of the cloth alone

    >>> report = fabrig.bench.runtime(frames=10)  # doctest: +SKIP
    >>> report["faces"][0]["with_skin"]["median"]  # doctest: +SKIP
    """
    return _fabrig.bench_runtime(rig, demo_take() if clip is None else clip, frames, progress)


def stability(
    rig: Rig | None = None, *, full: bool = False, progress: Progress = None
) -> list[dict[str, Any]]:
    """The solver's hard cases, each with its worst figure and whether it `passed`.

    - `rig`: the face of those that need one; the bundled one by default
    - `full`: a million frames at a held target and a thousand random scenes

    >>> all(case["passed"] for case in fabrig.bench.stability())  # doctest: +SKIP
    True
    """
    return _fabrig.bench_stability(rig, full, progress)


def table3(
    faces: Mapping[str, tuple[Mesh | Path, Mapping[str, Any] | Path]] | None = None,
    *,
    filter: str = "",
    methods: Sequence[str] | None = None,
    template: Template | str | PathLike[str] | None = None,
    progress: Progress = None,
) -> dict[str, Any]:
    """How near rigs come to faces' own expressions, beside whole-face delta transfer (mm).

    - `faces`: name -> (neutral mesh, its own expressions as `fabrig.rig` takes them); bundled
      synthetic faces by default
    - `filter`: only bundled faces whose name has this in it
    - `methods`: only these, by name
    - `template`: the template that they are rigged with

    >>> table = fabrig.bench.table3(filter="goblin", methods=["delta"])  # doctest: +SKIP
    """
    given = None if faces is None else [(name, *face) for name, face in faces.items()]
    named = None if methods is None else list(methods)
    return _fabrig.bench_table3(given, filter, named, template, progress)
