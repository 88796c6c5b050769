"""Colliders that code moves, and what is reported of them."""

import fabrig
import numpy as np
import pytest

DT = 1 / 60


def ball(position, radius=12.0):
    return {
        "name": "ball",
        "frame": "head",
        "shape": {"type": "ball", "radius": radius},
        "keys": [{"time": 0.0, "position": list(position)}],
    }


@pytest.fixture(scope="module")
def pressed(rig):
    """A face with a ball that code presses into its brow."""
    simulation = fabrig.Simulation(rig)
    skin = simulation.skin
    near = skin[(np.abs(skin[:, 0]) < 4) & (np.abs(skin[:, 1] - 50) < 4)]
    front = near[np.argmax(near[:, 2])]
    far = front + [0, 0, 80]
    simulation = fabrig.Simulation(
        rig, scene={"contact": {"pairs": "sphincter"}, "colliders": [ball(far)]}
    )
    for depth in np.linspace(-20, 3, 12):
        simulation.set_collider("ball", front + [0, 0, 12 - depth])
        simulation.step(DT)
    return simulation, front + [0, 0, 12 - 3], skin


def test_a_ball_set_from_code_presses_the_skin(pressed):
    simulation, center, rest = pressed
    distance = np.linalg.norm(simulation.skin - center, axis=1)
    assert distance.min() > 12.0 - 1e-3
    assert np.linalg.norm(rest - center, axis=1).min() < 12.0 - 2.0
    force = simulation.collider_forces["ball"]
    assert force.shape == (3,) and force[2] > 0
    assert simulation.contact["contacts"] > 0
    assert simulation.contact_points.shape[1] == 3


def test_bad_scenes_and_colliders_are_refused(rig, pressed):
    simulation, center, _ = pressed
    with pytest.raises(fabrig.InputError, match="there are: ball"):
        simulation.set_collider("stick", center)
    with pytest.raises(fabrig.InputError, match="position"):
        simulation.set_collider("ball", [0.0, np.nan, 0.0])
    with pytest.raises(fabrig.SceneError, match="radius"):
        fabrig.Simulation(rig, scene={"colliders": [ball([0, 0, 200], radius=-1.0)]})
    with pytest.raises(fabrig.SceneError, match="colour"):
        fabrig.Simulation(rig, scene={"colour": "red"})
    with pytest.raises(fabrig.InputError, match="scene"):
        fabrig.Simulation(rig, scene={"gravity": object()})
    assert fabrig.Simulation(rig).contact is None
