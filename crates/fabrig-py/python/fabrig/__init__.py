"""A physical face rig from one neutral mesh.

>>> import fabrig
>>> face = fabrig.demo_face()
>>> rig = fabrig.rig(face.vertices, face.faces)
>>> report = fabrig.animate(rig, fabrig.demo_take(), "demo.mcap")
"""

from ._fabrig import (
    Clip,
    Cloth,
    ExportError,
    FabrigError,
    InputError,
    Mesh,
    MeshError,
    MotionError,
    RecordingError,
    RegistrationError,
    Rig,
    RigError,
    SceneError,
    Simulation,
    Template,
    TemplateError,
    __version__,
    animate,
    convert,
    demo_face,
    demo_take,
    read_mesh,
    read_motion,
    read_shapes,
    rig,
    template,
)

__all__ = [
    "Clip",
    "Cloth",
    "ExportError",
    "FabrigError",
    "InputError",
    "Mesh",
    "MeshError",
    "MotionError",
    "RecordingError",
    "RegistrationError",
    "Rig",
    "RigError",
    "SceneError",
    "Simulation",
    "Template",
    "TemplateError",
    "__version__",
    "animate",
    "convert",
    "demo_face",
    "demo_take",
    "read_mesh",
    "read_motion",
    "read_shapes",
    "rig",
    "template",
]
