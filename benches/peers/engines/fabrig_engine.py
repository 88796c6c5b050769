"""fabrig's own solver. It works in millimetres."""

import fabrig
import numpy as np

import scenes
from engines.clock import Clock

UNIT = 87.0**2
"""Stiffness of a resistance of 1, per unit of mass [1/s^2]."""


class Engine:
    """One cloth of all sheets."""

    def __init__(self, scene, substeps, **options):
        # Gravity pulls here as it does elsewhere, rather than being part of the rest shape.
        self.cloth = fabrig.Cloth(
            [1e3 * sheet for sheet in scene.rest],
            substeps=substeps,
            rest_blend=0.0,
            rest_imperfection=0.0,
            standing_gravity=(0.0, 0.0, 0.0),
            **options,
        )
        self.rest = [1e3 * sheet for sheet in scene.rest]
        self.gravity = (0.0, -1e3 * scenes.GRAVITY, 0.0)

    def step(self, targets):
        """One frame."""
        goals = self.rest if targets is None else [1e3 * sheet for sheet in targets]
        with Clock() as clock:
            report = self.cloth.step(1 / scenes.FPS, goals, gravity=self.gravity)
        # Without the copying of arrays between Python and Rust.
        clock.wall_ms = report["milliseconds"]
        return clock

    def positions(self):
        """Positions of all nodes."""
        return 1e-3 * np.concatenate([p.reshape(-1, 3) for p in self.cloth.positions])


def patches(scene, substeps, **options):
    """The muscle material without shear."""
    material = {
        "mass": 1.0,
        "stretch_resistance": scenes.STRETCH / UNIT,
        "compression_resistance": scenes.STRETCH / UNIT,
        "shear_resistance": 0.0,
        "bend_resistance": 50 * scenes.BEND / UNIT,
        "damping": scenes.DAMPING,
        "stretch_damping": 0.0,
        "magnet_frequency_hz": np.sqrt(scenes.MAGNET) / (2 * np.pi),
        "magnet_damping_ratio": 0.0,
    }
    return Engine(scene, substeps, material=material, **options)


def patches_double(scene, substeps):
    """The same in double precision, for the strain that short steps come to."""
    return patches(scene, substeps, precision="double")


def hanging(scene, substeps):
    """No magnet; the upper row at anchors."""
    resistance = scene.stiffness / UNIT
    material = {
        "mass": 1.0,
        "stretch_resistance": resistance,
        "compression_resistance": resistance,
        "shear_resistance": 0.0,
        "bend_resistance": 0.0,
        "damping": scenes.DAMPING,
        "stretch_damping": 0.0,
        "magnet_frequency_hz": 0.0,
        "magnet_damping_ratio": 0.0,
    }
    return Engine(
        scene,
        substeps,
        material=material,
        anchors=[list(range(scene.side))],
        anchor_strength=1e6,
    )
