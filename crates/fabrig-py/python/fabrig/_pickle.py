"""What pickles name: functions that make objects of the native module again."""

from ._fabrig import Clip, Mesh, Rig


def mesh(data: bytes) -> Mesh:
    return Mesh._from_bytes(data)


def rig(data: bytes) -> Rig:
    return Rig._from_bytes(data)


def clip(data: bytes) -> Clip:
    return Clip._from_bytes(data)
