"""The two cloth scenes, as numbers that every engine is given, and what is measured on them.

Positions are in metres, masses in kilograms, +Y up. Every node has mass 1: stiffnesses are those
of fabrig's standard muscle material, per unit of mass.
"""

import dataclasses

import numpy as np

GRAVITY = 9.81
FPS = 60
STRETCH = 10 * 87.0**2
"""Stiffness of an edge of the patches [N/m]."""
MAGNET = (2 * np.pi * 12) ** 2
"""Stiffness of the spring that draws a node to its target [N/m]."""
BEND = 5 * 87.0**2 / 50
"""Stiffness against bending, per second difference [N/m]."""
DAMPING = 0.72
"""Rate at which a free node loses its velocity [1/s]."""


@dataclasses.dataclass
class Sheets:
    """Equal grids, each (rows, columns), nodes row by row, sheet by sheet."""

    rest: np.ndarray
    """Positions at rest [m], shape (sheets, rows, columns, 3)."""

    @property
    def node_count(self):
        """Nodes of all sheets."""
        return self.rest.reshape(-1, 3).shape[0]

    @property
    def spacing(self):
        """Mean length of an edge at rest [m]."""
        edges, rest = self.edges(), self.rest.reshape(-1, 3)
        return float(np.linalg.norm(rest[edges[:, 1]] - rest[edges[:, 0]], axis=1).mean())

    def indices(self):
        """Number of each node, shape (sheets, rows, columns)."""
        return np.arange(self.node_count).reshape(self.rest.shape[:3])

    def edges(self):
        """Pairs of neighbours along rows and columns."""
        i = self.indices()
        rows = np.stack([i[:, :, :-1], i[:, :, 1:]], -1).reshape(-1, 2)
        columns = np.stack([i[:, :-1], i[:, 1:]], -1).reshape(-1, 2)
        return np.concatenate([rows, columns])

    def bends(self):
        """Pairs two edges apart along rows and columns."""
        i = self.indices()
        rows = np.stack([i[:, :, :-2], i[:, :, 2:]], -1).reshape(-1, 2)
        columns = np.stack([i[:, :-2], i[:, 2:]], -1).reshape(-1, 2)
        return np.concatenate([rows, columns])

    def triangles(self):
        """Two triangles for each cell."""
        i = self.indices()
        a, b, c, d = i[:, :-1, :-1], i[:, :-1, 1:], i[:, 1:, 1:], i[:, 1:, :-1]
        return np.concatenate(
            [np.stack([a, b, c], -1).reshape(-1, 3), np.stack([a, c, d], -1).reshape(-1, 3)]
        )

    def strain(self, positions):
        """Root mean square of the edges' relative change of length."""
        edges = self.edges()
        rest, now = self.rest.reshape(-1, 3), positions.reshape(-1, 3)
        length = np.linalg.norm(rest[edges[:, 1]] - rest[edges[:, 0]], axis=1)
        change = np.linalg.norm(now[edges[:, 1]] - now[edges[:, 0]], axis=1) / length - 1
        return float(np.sqrt(np.mean(change**2)))


class Patches(Sheets):
    """Curved patches of 31 x 31 nodes, 30 mm wide, every node drawn to a moving target.

    The targets are sums of two fixed fields: all swing up and down by 8 mm at 1.5 Hz, and a wave
    of 1.5 mm across runs through each patch at 4 Hz.
    """

    def __init__(self, count=20, side=31):
        u, v = np.meshgrid(np.linspace(-1, 1, side), np.linspace(-1, 1, side))
        sheets = []
        for k in range(count):
            bulge = 0.15 + 0.02 * k
            z = -bulge * (u**2 + 0.5 * v**2)
            place = np.array([0.04 * (k % 5), 0.04 * (k // 5), 0.0])
            sheets.append(0.015 * np.stack([u, v, z], -1) + place)
        super().__init__(np.array(sheets))
        wave = np.zeros_like(self.rest)
        for k in range(count):
            wave[k, :, :, 2] = 0.0015 * np.sin(np.pi * (u + 0.1 * k)) * np.cos(0.5 * np.pi * v)
        swing = np.zeros_like(self.rest)
        swing[..., 1] = 0.008
        self.fields = [swing, wave]

    def shares(self, time):
        """How much of each field there is at a time [s]."""
        return [np.sin(2 * np.pi * 1.5 * time), np.sin(2 * np.pi * 4 * time)]

    def targets(self, time):
        """Targets at a time [s], shape of the rest positions [m]."""
        return self.rest + sum(s * f for s, f in zip(self.shares(time), self.fields))


class Hanging(Sheets):
    """A cloth of 40 x 40 nodes, 1 m wide, hung by its upper row, without shear or bending.

    Each column is a chain of springs, so at rest the edge under row r carries the nodes below it:
    it is longer by (side - 1 - r) m g / k. The stiffness makes the whole 1 % longer.
    """

    def __init__(self, side=40, elongation=0.01):
        x, y = np.meshgrid(np.linspace(0, 1, side), np.linspace(0, -1, side))
        super().__init__(np.stack([x, y, 0 * x], -1)[None])
        self.side = side
        self.elongation = elongation
        self.stiffness = GRAVITY * side * (side - 1) / 2 / elongation

    def measured(self, positions):
        """Relative elongation of the mean column."""
        y = positions.reshape(self.side, self.side, 3)[:, :, 1]
        return float(np.mean(y[0] - y[-1]) - 1)
