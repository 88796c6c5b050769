"""MuJoCo: a flex whose edges are equality constraints; joint springs draw nodes to targets."""

import mujoco
import numpy as np

import scenes
from engines.clock import Clock

STIFF_TIME = 0.02
"""Time constant of the edge constraints; MuJoCo asks for at least two steps of it [s]."""


class Engine:
    """One body with three sliding joints per node, as MuJoCo makes of a flex."""

    def __init__(self, scene, substeps, magnet=0.0, held=()):
        self.substeps = substeps
        h = 1 / scenes.FPS / substeps
        rest = scene.rest.reshape(-1, 3)
        self.rest = rest
        points = " ".join(f"{x:.9g}" for x in rest.ravel())
        faces = " ".join(str(i) for i in scene.triangles().ravel())
        pins = " ".join(str(i) for i in held)
        pin = f'<pin id="{pins}"/>' if pins else ""
        xml = f"""
        <mujoco>
          <option timestep="{h:.12g}" gravity="0 {-scenes.GRAVITY} 0" solver="CG"
                  iterations="20" integrator="implicitfast" jacobian="sparse"/>
          <size memory="4G"/>
          <worldbody>
            <flexcomp name="cloth" type="direct" dim="2" mass="{len(rest)}" radius="0.0001"
                      point="{points}" element="{faces}">
              <edge equality="true" solref="{max(STIFF_TIME, 2 * h):.9g} 1"/>
              <contact contype="0" conaffinity="0" selfcollide="none"/>
              {pin}
            </flexcomp>
          </worldbody>
        </mujoco>"""
        self.model = mujoco.MjModel.from_xml_string(xml)
        self.data = mujoco.MjData(self.model)
        self.has_targets = magnet > 0
        if self.has_targets:
            self.model.jnt_stiffness[:] = magnet
        self.model.dof_damping[:] = scenes.DAMPING
        mujoco.mj_forward(self.model, self.data)

    def step(self, targets):
        """One frame; the targets go straight from the last frame's to this one's."""
        if self.has_targets:
            starts = self.model.qpos_spring.copy()
            ends = (targets.reshape(-1, 3) - self.rest).ravel()
        clock = Clock()
        for k in range(self.substeps):
            if self.has_targets:
                self.model.qpos_spring[:] = starts + (k + 1) / self.substeps * (ends - starts)
            with clock:
                mujoco.mj_step(self.model, self.data)
        return clock

    def positions(self):
        """Positions of the flex's vertices."""
        mujoco.mj_kinematics(self.model, self.data)
        mujoco.mj_flex(self.model, self.data)
        return np.array(self.data.flexvert_xpos)


def patches(scene, substeps):
    """Equality edges, springs in the joints."""
    return Engine(scene, substeps, magnet=scenes.MAGNET)


def hanging(scene, substeps):
    """Equality edges, the upper row pinned."""
    return Engine(scene, substeps, held=range(scene.side))
