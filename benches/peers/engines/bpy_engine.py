"""Blender: its implicit cloth modifier; pinned at part weight, nodes are drawn to shape keys."""

import bpy
import numpy as np

import scenes
from engines.clock import Clock

UNIT = 1e-3
"""Blender's stiffnesses of springs are per length at rest and in thousands of N/m; found by the
elongation and the sag of cloths at rest."""
MOST_FRAMES = 300
"""Frames that are animated."""


class Engine:
    """One mesh with a cloth modifier; frames are those of the scene."""

    def __init__(self, sheets, substeps, stiffness, bend, fields=(), pins=None, pin_stiffness=0.0):
        bpy.ops.wm.read_factory_settings(use_empty=True)
        scene = bpy.context.scene
        scene.render.fps = scenes.FPS
        # Blender is Z up: y becomes z.
        scene.gravity = (0, 0, -scenes.GRAVITY)
        mesh = bpy.data.meshes.new("cloth")
        rest = turned(sheets.rest.reshape(-1, 3))
        i = sheets.indices()
        quads = np.stack([i[:, :-1, :-1], i[:, :-1, 1:], i[:, 1:, 1:], i[:, 1:, :-1]], -1)
        mesh.from_pydata(rest.tolist(), [], quads.reshape(-1, 4).tolist())
        self.object = bpy.data.objects.new("cloth", mesh)
        scene.collection.objects.link(self.object)
        self.keys = []
        if fields:
            self.object.shape_key_add(name="rest")
            for k, field in enumerate(fields):
                key = self.object.shape_key_add(name=f"field{k}")
                key.slider_min, key.slider_max, key.value = -1.0, 1.0, 0.0
                key.data.foreach_set("co", (rest + turned(field.reshape(-1, 3))).ravel())
                self.keys.append(key)
        group = self.object.vertex_groups.new(name="pin")
        nodes, weight = pins
        group.add(list(nodes), weight, "REPLACE")
        self.modifier = self.object.modifiers.new("cloth", "CLOTH")
        cloth = self.modifier.settings
        cloth.quality = substeps
        cloth.mass = 1.0
        cloth.air_damping = 0.0
        cloth.tension_stiffness = cloth.compression_stiffness = stiffness
        cloth.shear_stiffness = 0.0
        cloth.bending_model = "LINEAR"
        cloth.bending_stiffness = bend
        cloth.tension_damping = cloth.compression_damping = cloth.shear_damping = 0.0
        cloth.bending_damping = 0.0
        cloth.vertex_group_mass = "pin"
        cloth.pin_stiffness = pin_stiffness
        self.modifier.collision_settings.use_collision = False
        self.modifier.point_cache.frame_start = 1
        self.modifier.point_cache.frame_end = 10_000
        self.frame = 1
        scene.frame_set(1)
        self.positions()

    def animate(self, shares, frames):
        """Keys the shape keys for all frames: values set in between are passed over."""
        for frame in range(frames + 1):
            for key, share in zip(self.keys, shares(frame / scenes.FPS)):
                key.value = float(share)
                key.keyframe_insert("value", frame=1 + frame)

    def step(self, targets):
        """One frame."""
        del targets
        self.frame += 1
        with Clock() as clock:
            bpy.context.scene.frame_set(self.frame)
        return clock

    def positions(self):
        """Positions of the evaluated mesh."""
        graph = bpy.context.evaluated_depsgraph_get()
        mesh = self.object.evaluated_get(graph).data
        flat = np.empty(3 * len(mesh.vertices), np.float32)
        mesh.vertices.foreach_get("co", flat)
        x, y, z = flat.reshape(-1, 3).astype(float).T
        return np.stack([x, z, -y], 1)


def turned(points):
    """+Y up to +Z up."""
    x, y, z = points.T
    return np.stack([x, -z, y], 1)


def patches(scene, substeps):
    """Pinned at half weight, which counts by its fourth power."""
    made = Engine(
        scene,
        substeps,
        scenes.STRETCH * scene.spacing * UNIT,
        scenes.BEND * scene.spacing * UNIT,
        fields=scene.fields,
        pins=(range(scene.node_count), 0.5),
        pin_stiffness=scenes.MAGNET * UNIT / 0.5**4,
    )
    made.animate(scene.shares, MOST_FRAMES)
    return made


def hanging(scene, substeps):
    """The upper row pinned."""
    stiffness = scene.stiffness * scene.spacing * UNIT
    return Engine(scene, substeps, stiffness, 0.0, pins=(range(scene.side), 1.0))
