from collections.abc import Callable, Iterable, Mapping, Sequence
from os import PathLike
from typing import Any, TypedDict

import numpy as np
from numpy.typing import ArrayLike, NDArray

__version__: str

class FabrigError(Exception): ...
class InputError(FabrigError): ...
class MeshError(FabrigError): ...
class TemplateError(FabrigError): ...
class RegistrationError(FabrigError): ...
class RigError(FabrigError): ...
class MotionError(FabrigError): ...
class SceneError(FabrigError): ...
class ExportError(FabrigError): ...
class RecordingError(FabrigError): ...

Faces = NDArray[np.integer[Any]] | Sequence[Sequence[int]]
Path = str | PathLike[str]
Progress = Callable[[str, float], object]

MaterialLike = str | Mapping[str, float | str]

class Cloth:
    def __init__(
        self,
        grids: Iterable[ArrayLike],
        *,
        material: MaterialLike | Sequence[MaterialLike] | None = None,
        periodic: bool | Sequence[bool] | None = None,
        anchors: Sequence[Sequence[int] | None] | None = None,
        anchor_strength: float = 1.0,
        pairs: Sequence[tuple[int, int, Sequence[tuple[int, int]], float]] | None = None,
        substeps: int | None = None,
        rest_blend: float | None = None,
        rest_imperfection: float | None = None,
        seed: int | None = None,
        standing_gravity: ArrayLike | None = None,
        precision: str | None = None,
        integrator: str | None = None,
    ) -> None: ...
    def step(
        self,
        dt: float,
        targets: Iterable[ArrayLike],
        velocities: Iterable[ArrayLike] | None = None,
        *,
        anchors: Iterable[ArrayLike | None] | None = None,
        gravity: ArrayLike | None = None,
        wind: ArrayLike | None = None,
    ) -> dict[str, Any]: ...
    def reset(
        self,
        targets: Iterable[ArrayLike],
        velocities: Iterable[ArrayLike] | None = None,
        *,
        anchors: Iterable[ArrayLike | None] | None = None,
    ) -> None: ...
    @property
    def positions(self) -> list[NDArray[np.float32]]: ...
    @property
    def patch_count(self) -> int: ...

class Mesh:
    def __init__(self, vertices: ArrayLike, faces: Faces) -> None: ...
    @property
    def vertices(self) -> NDArray[np.float64]: ...
    @property
    def faces(self) -> list[list[int]]: ...
    @property
    def triangles(self) -> NDArray[np.uint32]: ...
    def write_obj(self, path: Path) -> None: ...

class Template:
    @property
    def mesh(self) -> Mesh: ...
    @property
    def landmarks(self) -> dict[str, int]: ...
    @property
    def regions(self) -> list[str]: ...

class Rig:
    @staticmethod
    def load(path: Path, *, edits: bool = True) -> Rig: ...
    def with_edits(self, path: Path) -> Rig: ...
    def save(self, path: Path) -> None: ...
    def export(
        self,
        path: Path,
        *,
        motion: Clip | None = None,
        baked: bool = False,
        face: Path | None = None,
        unit: str | None = None,
        name: str | None = None,
        fps: float | None = None,
        shapes: str = "settled",
        still_head: bool = False,
        components: int | None = None,
        tolerance: float | None = None,
        check: bool = True,
        scene: Mapping[str, Any] | None = None,
        progress: Progress | None = None,
    ) -> dict[str, Any]: ...
    @property
    def mesh(self) -> Mesh: ...
    @property
    def normalized(self) -> NDArray[np.float64]: ...
    @property
    def shape_names(self) -> list[str]: ...
    @property
    def alphas(self) -> dict[str, float]: ...
    @property
    def patch_names(self) -> list[str]: ...
    @property
    def node_count(self) -> int: ...
    @property
    def millimetres_per_unit(self) -> float: ...
    @property
    def to_head(self) -> NDArray[np.float64]: ...
    @property
    def report(self) -> dict[str, Any]: ...
    def check(
        self,
        *,
        gates: Mapping[str, float] | None = None,
        template: Path | None = None,
        progress: Progress | None = None,
    ) -> CheckReport: ...

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

class Clip:
    def __init__(
        self, times: ArrayLike, channels: Sequence[str], weights: ArrayLike
    ) -> None: ...
    @property
    def times(self) -> NDArray[np.float64]: ...
    @property
    def channels(self) -> list[str]: ...
    @property
    def weights(self) -> NDArray[np.float32]: ...
    @property
    def duration(self) -> float: ...
    @property
    def frame_rate(self) -> float | None: ...
    @property
    def notes(self) -> dict[str, Any]: ...
    def sample(self, time: float) -> NDArray[np.float32]: ...
    def resampled(self, rate: float) -> Clip: ...
    def to_csv(self) -> str: ...
    def __len__(self) -> int: ...

class Simulation:
    def __init__(
        self,
        rig: Rig,
        clip: Clip | None = None,
        *,
        scene: Mapping[str, Any] | None = None,
        gravity: ArrayLike | None = None,
        wind: ArrayLike | None = None,
        substeps: int | None = None,
        dynamics: bool = True,
    ) -> None: ...
    def step(self, dt: float, *, weights: ArrayLike | None = None) -> dict[str, Any]: ...
    def set_collider(
        self, name: str, position: ArrayLike, *, rotation: ArrayLike | None = None
    ) -> None: ...
    @property
    def collider_forces(self) -> dict[str, NDArray[np.float64]]: ...
    @property
    def contact(self) -> dict[str, Any] | None: ...
    @property
    def contact_points(self) -> NDArray[np.float32]: ...
    @property
    def time(self) -> float: ...
    @property
    def rig(self) -> Rig: ...
    @property
    def vertices(self) -> NDArray[np.float64]: ...
    @property
    def skin(self) -> NDArray[np.float32]: ...
    @property
    def weights(self) -> NDArray[np.float32]: ...
    @property
    def head(self) -> NDArray[np.float64]: ...
    def patch(self, name: str) -> NDArray[np.float32]: ...

def read_mesh(path: Path) -> Mesh: ...
def read_shapes(path: Path) -> dict[str, NDArray[np.float64]]: ...
def demo_face() -> Mesh: ...
def template() -> Template: ...
def demo_take() -> Clip: ...
def read_motion(
    path: Path,
    *,
    format: str | None = None,
    frame_rate: float | None = None,
    ignore_unknown_columns: bool = False,
    clamp_weights: bool = False,
    calibrate_neutral: tuple[float, float] | None = None,
    gains: Mapping[str, float] | None = None,
    swap_sides: bool = False,
) -> Clip: ...
def rig(
    vertices: ArrayLike | Mesh,
    faces: Faces | None = None,
    *,
    landmarks: Mapping[str, Sequence[float]] | None = None,
    unit_mm: float | None = None,
    cut_seams: Sequence[str] | None = None,
    expressions: Mapping[str, ArrayLike] | None = None,
    alpha: str = "own",
    offsets: str = "global",
    template: Path | None = None,
    progress: Progress | None = None,
) -> Rig: ...
def animate(
    rig: Rig,
    clip: Clip,
    output: Path,
    *,
    scene: Mapping[str, Any] | None = None,
    fps: float | None = None,
    gravity: ArrayLike | None = None,
    wind: ArrayLike | None = None,
    substeps: int | None = None,
    dynamics: bool = True,
    progress: Progress | None = None,
) -> dict[str, Any]: ...
def convert(
    recording: Path,
    output: Path,
    *,
    rig: Rig | None = None,
    face: Path | None = None,
    unit: str | None = None,
    name: str | None = None,
    still_head: bool = False,
    components: int | None = None,
    tolerance: float | None = None,
    progress: Progress | None = None,
) -> dict[str, Any]: ...
