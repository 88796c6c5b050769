"""The solver alone, from Python."""

import fabrig
import numpy as np
import pytest


def sheet(rows=20, columns=21, edge=2.0):
    v, u = np.mgrid[0:rows, 0:columns] * edge
    return np.stack([u, v, 10 - 0.01 * (u - 20) ** 2], axis=-1)


def test_a_sheet_at_rest_stays_and_follows_its_target():
    rest = sheet()
    cloth = fabrig.Cloth([rest, rest + [0, 50, 0]], material=["linear", "fat"])
    assert cloth.patch_count == 2
    targets = [rest, rest + [0, 50, 0]]
    cloth.step(1 / 60, targets)
    assert np.array_equal(cloth.positions[0], rest.astype(np.float32))
    moved = [t + [0, 0, 3] for t in targets]
    zero = [np.zeros_like(rest)] * 2
    for _ in range(200):
        report = cloth.step(1 / 60, moved, zero)
    for now, target in zip(cloth.positions, moved):
        assert now.shape == (20, 21, 3) and now.dtype == np.float32
        assert np.abs(now - target).max() < 0.02
    assert report["counters"]["frozen_patches"] == 0
    assert report["milliseconds"] > 0


def test_a_hanging_chain_is_as_long_as_hooke_says():
    links, edge, gravity = 10, 2.0, 981.0
    rest = np.zeros((1, links + 1, 3))
    rest[0, :, 1] = -edge * np.arange(links + 1)
    spring = {
        "stretch_resistance": 10, "compression_resistance": 10, "shear_resistance": 0,
        "bend_resistance": 0, "damping": 12, "stretch_damping": 0, "magnet_frequency_hz": 0,
    }
    cloth = fabrig.Cloth(
        [rest], material=spring, anchors=[[0]], anchor_strength=1e4, rest_blend=0.0,
        substeps=128, standing_gravity=(0, 0, 0), precision="double",
    )
    for _ in range(300):
        cloth.step(1 / 60, [rest], gravity=(0, -gravity, 0))
    stiffness = 10 * 87.0**2  # r / TIME_UNIT^2
    expected = sum((links - i) * gravity / stiffness for i in range(links))
    length = float(-cloth.positions[0][0, -1, 1]) - links * edge
    assert length == pytest.approx(expected, rel=0.02)


def test_rings_pairs_and_reset():
    angle = np.arange(24) / 24 * 2 * np.pi
    ring = np.array([[(r * np.cos(a), r * np.sin(a), 0) for a in angle] for r in (10, 12, 14)])
    pairs = [(0, 1, [(0, 0), (5, 5)], 0.5)]
    cloth = fabrig.Cloth([ring, ring + [0, 0, 2]], periodic=True, pairs=pairs, material="sphincter")
    away = [ring + [100, 0, 0], ring + [100, 0, 2]]
    cloth.reset(away)
    assert np.array_equal(cloth.positions[1], away[1].astype(np.float32))


def test_equal_input_gives_equal_bits():
    def run():
        cloth = fabrig.Cloth([sheet()] * 9, material="fat", rest_blend=0.5)
        for k in range(1, 6):
            cloth.step(1 / 60, [sheet() * (1 - 0.02 * k)] * 9)
        return np.stack(cloth.positions)

    assert np.array_equal(run(), run())


@pytest.mark.parametrize(
    "arguments, words",
    [
        (dict(grids=[np.zeros((4, 3))]), r"grids: patch 0: expected numbers of shape"),
        (dict(grids=3), "grids: expected a sequence"),
        (dict(grids=[sheet()], material="bone"), "no material is called `bone`"),
        (dict(grids=[sheet()], material={"mas": 1}), "unknown field `mas`"),
        (dict(grids=[sheet()], material={"mass": float("nan")}), "`mass` is"),
        (dict(grids=[sheet()], material=["fat", "fat"]), "expected one for each of 1 patches, got 2"),
        (dict(grids=[sheet()], anchors=[[-1]]), "node index -1"),
        (dict(grids=[sheet()], anchors=[[420]]), "names node 420"),
        (dict(grids=[sheet()], precision="half"), "precision: unknown variant `half`"),
        (dict(grids=[sheet()], substeps=0), "substeps"),
        (dict(grids=[sheet() * np.nan]), "not finite"),
        (dict(grids=[sheet()], pairs=[(4, 0, [(0, 0)], 1.0)]), "no patch 4"),
    ],
)
def test_bad_cloth_is_refused(arguments, words):
    with pytest.raises(fabrig.FabrigError, match=words):
        fabrig.Cloth(arguments.pop("grids"), **arguments)


def test_bad_frames_are_refused_and_change_nothing():
    cloth = fabrig.Cloth([sheet()])
    before = cloth.positions[0]
    with pytest.raises(fabrig.InputError, match=r"targets: patch 0: expected shape \(20, 21, 3\)"):
        cloth.step(1 / 60, [sheet()[:5]])
    with pytest.raises(fabrig.InputError, match="targets: expected one array for each of 1 patches"):
        cloth.step(1 / 60, [])
    for dt in (0, -1, float("nan")):
        with pytest.raises(fabrig.SceneError):
            cloth.step(dt, [sheet()])
    with pytest.raises(fabrig.SceneError, match="not finite"):
        cloth.step(1 / 60, [sheet() * np.inf])
    assert np.array_equal(cloth.positions[0], before)
