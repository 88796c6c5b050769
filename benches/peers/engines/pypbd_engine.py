"""pyPBD: XPBD distance constraints for stretch, bend and the pull to the targets."""

import numpy as np
import pypbd as pbd

import scenes
from engines.clock import Clock

SWEEPS = 1


class Engine:
    """Particles, then as many still ones that carry the targets."""

    def __init__(self, rest, springs, substeps, targets=None, held=()):
        pbd.Logger.addConsoleSink(pbd.LogLevel.ERR)
        self.simulation = pbd.Simulation.getCurrent()
        self.simulation.initDefault()
        self.model = self.simulation.getModel()
        self.count = len(rest)
        self.has_targets = targets is not None
        particles = self.model.getParticles()
        for point in rest:
            particles.addVertex(point)
        for point in rest if self.has_targets else ():
            particles.addVertex(point)
        for node in range(self.count):
            particles.setMass(node, 1.0)
        for node in [*held, *range(self.count, particles.size())]:
            particles.setMass(node, 0.0)
        for pairs, stiffness in springs:
            for a, b in pairs.tolist():
                self.model.addDistanceConstraint_XPBD(a, b, stiffness)
        for node in range(self.count if self.has_targets else 0):
            self.model.addDistanceConstraint_XPBD(node, self.count + node, targets)
        self.stepper = self.simulation.getTimeStep()
        pbd.TimeManager.getCurrent().setTimeStepSize(1 / scenes.FPS)
        self.stepper.setValueUInt(pbd.TimeStepController.NUM_SUB_STEPS, substeps)
        self.stepper.setValueUInt(pbd.TimeStepController.MAX_ITERATIONS, SWEEPS)

    def step(self, targets):
        """One frame."""
        if self.has_targets:
            # What the binding shows of its memory is read-only; this is not timed.
            particles = self.model.getParticles()
            for node, target in enumerate(targets.reshape(-1, 3), self.count):
                particles.setPosition(node, target)
        with Clock() as clock:
            self.stepper.step(self.model)
        return clock

    def positions(self):
        """Positions of the particles."""
        return np.array(self.model.getParticles().getVertices())[: self.count]


def patches(scene, substeps):
    """Springs along edges, weaker ones two edges apart, and to the targets."""
    springs = [(scene.edges(), scenes.STRETCH), (scene.bends(), scenes.BEND)]
    return Engine(scene.rest.reshape(-1, 3), springs, substeps, targets=scenes.MAGNET)


def hanging(scene, substeps):
    """Springs along edges, the upper row held."""
    springs = [(scene.edges(), scene.stiffness)]
    return Engine(scene.rest.reshape(-1, 3), springs, substeps, held=range(scene.side))
