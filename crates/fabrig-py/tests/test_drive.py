"""Takes of other tools, edits beside the rig, and a face's own expressions."""

import fabrig
import numpy as np
import pytest

CSV = "time,jawOpen,mouthClose,mouthSmileLeft\n" + "".join(
    f"{t / 10},{0.1 + 0.5 * (t > 4)},0.8,0.2\n" for t in range(10)
)


def test_a_take_is_fitted_to_its_performer(tmp_path):
    path = tmp_path / "take.csv"
    path.write_text(CSV)
    plain = fabrig.read_motion(path)
    jaw = plain.channels.index("jawOpen")
    assert np.allclose(plain.weights[:, jaw], [0.1] * 5 + [0.6] * 5)
    fitted = fabrig.read_motion(
        path, calibrate_neutral=(0, 0.4), gains={"jawOpen": 0.5}, swap_sides=True
    )
    assert np.allclose(fitted.weights[:5, fitted.channels.index("jawOpen")], 0)
    assert fitted.weights[9, fitted.channels.index("jawOpen")] == pytest.approx(0.5 * 0.5 / 0.9)
    assert "mouthSmileRight" in fitted.channels
    fine = plain.resampled(40)
    assert len(fine) == 37 and fine.frame_rate == pytest.approx(40)
    (tmp_path / "again.csv").write_text(fine.to_csv())
    again = fabrig.read_motion(tmp_path / "again.csv")
    assert np.allclose(again.sample(0.33), fine.sample(0.33), atol=1e-5)


@pytest.mark.parametrize(
    ("options", "part"),
    [
        ({"format": "maya"}, "media-pipe"),
        ({"gains": {"jawOpne": 1.0}}, "jawOpen"),
        ({"calibrate_neutral": (7.0, 8.0)}, "neutral"),
    ],
)
def test_a_bad_option_is_named(tmp_path, options, part):
    path = tmp_path / "take.csv"
    path.write_text(CSV)
    with pytest.raises(fabrig.FabrigError, match=part):
        fabrig.read_motion(path, **options)


def test_edits_beside_a_rig_are_applied_when_it_is_loaded(rig, tmp_path):
    path = tmp_path / "face.fabrig"
    rig.save(path)
    (tmp_path / "face.edits.toml").write_text("[patches.malar_fat_l]\nalpha = 1.25\n")
    assert fabrig.Rig.load(path).alphas["malar_fat_l"] == 1.25
    plain = fabrig.Rig.load(path, edits=False)
    assert plain.alphas == rig.alphas
    edited = plain.with_edits(tmp_path / "face.edits.toml")
    assert edited.alphas["malar_fat_l"] == 1.25 and plain.alphas == rig.alphas
    # Without its side a patch stands for both.
    (tmp_path / "face.edits.toml").write_text("[patches.malar_fat]\nalpha = 1.5\n")
    both = fabrig.Rig.load(path).alphas
    assert both == rig.alphas | {"malar_fat_l": 1.5, "malar_fat_r": 1.5}
    (tmp_path / "face.edits.toml").write_text("[patches.malar_fta_l]\nalpha = 1\n")
    with pytest.raises(fabrig.RigError, match="malar_fat_l"):
        fabrig.Rig.load(path)


def test_own_expressions_are_taken_over(face, rig):
    def pose(of):
        simulation = fabrig.Simulation(of, dynamics=False)
        weights = np.zeros(52)
        weights[of.shape_names.index("mouthSmileLeft")] = 1
        simulation.step(1 / 60, weights=weights)
        return simulation.vertices

    wide = face.vertices + 1.5 * (pose(rig) - face.vertices)
    own = fabrig.rig(face.vertices, face.faces, expressions={"mouthSmileLeft": wide})
    per_unit = rig.millimetres_per_unit
    left = np.abs(pose(own) - wide).max() * per_unit
    assert left < 0.3 * np.abs(pose(rig) - wide).max() * per_unit
    # As a scan: a mesh of its own, by a vertex more.
    scan = fabrig.Mesh(np.vstack([wide, wide[:1]]), face.faces)
    scanned = fabrig.rig(face.vertices, face.faces, expressions={"mouthSmileLeft": scan})
    moves = np.linalg.norm(wide - face.vertices, axis=1) * per_unit > 2
    errors = [np.linalg.norm((pose(of) - wide)[moves], axis=1).mean() for of in (rig, scanned)]
    assert errors[1] < 0.5 * errors[0]
    for bad, part in [
        ({"expressions": {"mouthSmileLetf": wide}}, "mouthSmileLeft"),
        ({"expressions": {"jawOpen": wide[:-1]}}, "vertices"),
        ({"alpha": "best"}, "own"),
        ({"offsets": "best"}, "transfer"),
    ]:
        with pytest.raises(fabrig.FabrigError, match=part):
            fabrig.rig(face.vertices, face.faces, **bad)
