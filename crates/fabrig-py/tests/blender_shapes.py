"""Run by a Python that has bpy: FILE.glb FILE.npz. Imports the glTF into Blender, puts each shape
to weight 1 and prints, as JSON, how far its vertices are from the archive's, over the face's size.
"""

import json
import sys

import bpy
import numpy as np

glb, archive = sys.argv[1:3]
bpy.ops.wm.read_factory_settings(use_empty=True)
bpy.ops.import_scene.gltf(filepath=glb)
(face,) = (o for o in bpy.data.objects if o.type == "MESH")
keys = face.data.shape_keys.key_blocks
expected = np.load(archive)
assert [key.name for key in keys][1:] == expected["shape_names"].tolist()
metres = float(expected["millimetres_per_unit"]) / 1000

attribute = face.data.attributes["_ORIGINAL_VERTEX"]
original = np.empty(len(attribute.data), np.float32)
attribute.data.foreach_get("value", original)
original = original.astype(int)


def evaluated():
    """Vertices as Blender shows them, from its +Z up back to +Y up."""
    mesh = face.evaluated_get(bpy.context.evaluated_depsgraph_get()).data
    flat = np.empty(3 * len(mesh.vertices), np.float32)
    mesh.vertices.foreach_get("co", flat)
    x, y, z = flat.reshape(-1, 3).T
    return np.stack([x, z, -y], axis=1)


rest = expected["vertices"] * metres
size = np.ptp(rest, axis=0).max()
errors = {}
for index, key in enumerate(list(keys)[1:]):
    for other in keys:
        other.value = 0
    key.value = 1
    want = (rest + expected["shapes"][index] * metres)[original]
    errors[key.name] = float(np.abs(evaluated() - want).max() / size)
print("RESULT" + json.dumps({"vertices": len(np.unique(original)), "errors": errors}))
