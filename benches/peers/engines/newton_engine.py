"""Newton on the CPU: particles and springs under its semi-implicit or its XPBD solver."""

import newton
import numpy as np
import warp as wp

import scenes
from engines.clock import Clock

OFF = np.array([0.0, 0.0, 1e-5])
"""What keeps a node from its target [m]."""


class Engine:
    """Particles, then as many still ones that carry the targets."""

    def __init__(self, rest, springs, substeps, solver, targets=None, held=()):
        wp.config.quiet = True
        self.count, self.substeps = len(rest), substeps
        self.has_targets = targets is not None
        builder = newton.ModelBuilder(up_axis=newton.Axis.Y, gravity=(0.0, -scenes.GRAVITY, 0.0))
        # A spring without length has no direction here: targets stand a little off.
        places = np.concatenate([rest, rest + OFF]) if self.has_targets else rest
        mass = np.zeros(len(places))
        mass[: self.count] = 1.0
        mass[list(held)] = 0.0
        builder.add_particles(
            [wp.vec3(*p) for p in places.tolist()],
            [wp.vec3(0.0, 0.0, 0.0)] * len(places),
            mass.tolist(),
            # No contact: with the default radius neighbours push each other away.
            radius=[1e-6] * len(places),
        )
        for pairs, stiffness in springs:
            for a, b in pairs.tolist():
                builder.add_spring(a, b, stiffness, 0.0, 0.0)
        for node in range(self.count if self.has_targets else 0):
            builder.add_spring(node, self.count + node, targets, 0.0, 0.0)
        self.model = builder.finalize(device="cpu")
        self.solver = solver(self.model)
        self.states = [self.model.state(), self.model.state()]
        self.control = self.model.control()

    def step(self, targets):
        """One frame; the targets go straight from the last frame's to this one's."""
        ends = None
        if self.has_targets:
            ends = (targets.reshape(-1, 3) + OFF).astype(np.float32)
            starts = self.states[0].particle_q.numpy()[self.count :].copy()
        clock = Clock()
        for k in range(self.substeps):
            if ends is not None:
                share = (k + 1) / self.substeps
                held = self.states[0].particle_q.numpy()
                held[self.count :] = starts + share * (ends - starts)
            h = 1 / scenes.FPS / self.substeps
            with clock:
                self.states[0].clear_forces()
                self.solver.step(self.states[0], self.states[1], self.control, None, h)
            self.states.reverse()
        return clock

    def positions(self):
        """Positions of the particles."""
        return self.states[0].particle_q.numpy()[: self.count].astype(float)


def _semi_implicit(model):
    # No contact is asked for, and looking for it would cost more than the rest.
    model.particle_grid = None
    return newton.solvers.SolverSemiImplicit(model)


def _xpbd(model):
    return newton.solvers.SolverXPBD(model, iterations=1)


def _patches(scene, substeps, solver):
    springs = [(scene.edges(), scenes.STRETCH), (scene.bends(), scenes.BEND)]
    rest = scene.rest.reshape(-1, 3)
    return Engine(rest, springs, substeps, solver, targets=scenes.MAGNET)


def _hanging(scene, substeps, solver):
    springs = [(scene.edges(), scene.stiffness)]
    rest = scene.rest.reshape(-1, 3)
    return Engine(rest, springs, substeps, solver, held=range(scene.side))


def patches(scene, substeps):
    """Semi-implicit Euler."""
    return _patches(scene, substeps, _semi_implicit)


def hanging(scene, substeps):
    """Semi-implicit Euler."""
    return _hanging(scene, substeps, _semi_implicit)


def patches_xpbd(scene, substeps):
    """XPBD."""
    return _patches(scene, substeps, _xpbd)


def hanging_xpbd(scene, substeps):
    """XPBD."""
    return _hanging(scene, substeps, _xpbd)
