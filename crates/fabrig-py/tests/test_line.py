"""The whole line: a mesh and a take become a rig, a moving skin, a recording."""

import fabrig
import numpy as np
import pytest


def test_a_rig_keeps_the_face_and_survives_the_disk(face, rig, tmp_path):
    assert np.array_equal(rig.mesh.vertices, face.vertices)
    assert len(rig.patch_names) == 44 and rig.node_count == 19_380
    assert len(rig.shape_names) == 52
    assert rig.report["template_to_face"]["median"] < 1.0
    rig.save(tmp_path / "face.fabrig")
    again = fabrig.Rig.load(tmp_path / "face.fabrig")
    assert np.array_equal(again.normalized, rig.normalized)


def test_resolution_and_jaw_are_chosen(face, rig):
    coarse = fabrig.rig(face, resolution="coarse", jaw="linear")
    assert coarse.node_count == 2_010
    opened = []
    for of in (rig, coarse):
        simulation = fabrig.Simulation(of, dynamics=False)
        simulation.reset(weights={"jawOpen": 0.5})
        opened.append(simulation.skin)
    # Half open, a straight way cuts the arc by about 2 mm.
    assert 0.5 < np.linalg.norm(opened[0] - opened[1], axis=1).max() < 6
    for options in ({"resolution": "huge"}, {"jaw": "loose"}):
        with pytest.raises(fabrig.InputError, match="is not one of"):
            fabrig.rig(face, **options)


def test_rest_stays_and_the_jaw_opens(rig):
    simulation = fabrig.Simulation(rig)
    rest = rig.mesh.vertices
    zero = np.zeros(52)
    simulation.step(1 / 60, weights=zero)
    assert np.abs(simulation.vertices - rest).max() * rig.millimetres_per_unit < 0.01
    weights = zero.copy()
    weights[rig.shape_names.index("jawOpen")] = 1
    for _ in range(30):
        report = simulation.step(1 / 60, weights=weights)
    moved = np.linalg.norm(simulation.vertices - rest, axis=1) * rig.millimetres_per_unit
    assert 20 < moved.max() < 60
    assert report["settle_rms"] < 0.3
    assert simulation.patch("masseter_l").shape == (420, 3)
    for bad in (zero[:5], zero + 2, zero * np.nan):
        with pytest.raises(fabrig.InputError, match="weights"):
            simulation.step(1 / 60, weights=bad)
    for dt in (0, -1, float("nan")):
        with pytest.raises(fabrig.FabrigError):
            simulation.step(dt)


def test_a_rig_is_checked_and_gates_can_be_moved(rig):
    report = rig.check()
    assert report["passes"] and report["findings"] == [] and report["marked"] == {}
    assert [s["shape"] for s in report["shapes"]] == rig.shape_names
    assert report["distances"].shape == (len(rig.mesh.vertices),)
    assert np.nanmedian(report["distances"]) < 0.5
    strict = rig.check(gates={"leak_mm": 0.0})
    assert not strict["passes"]
    assert {f["gate"] for f in strict["findings"]} == {"leak_mm"}
    for gates in ({"leek_mm": 1.0}, {"leak_mm": float("nan")}):
        with pytest.raises(fabrig.InputError, match="gates"):
            rig.check(gates=gates)


def test_progress_is_reported_and_may_stop(rig, tmp_path):
    clip = fabrig.demo_take()
    seen = []

    def stop(stage, share):
        seen.append((stage, share))
        if len(seen) == 5:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        fabrig.animate(rig, clip, tmp_path / "cut.mcap", progress=stop)
    assert len(seen) == 5 and all(0 < share < 1 for _, share in seen)
    assert (tmp_path / "cut.mcap").stat().st_size > 0


def test_cancelled_registration_raises_what_the_callback_raised(face):
    def stop(stage, share):
        raise RuntimeError(stage)

    with pytest.raises(RuntimeError):
        fabrig.rig(face.vertices, face.faces, progress=stop)


def test_bad_outputs_are_typed(rig, tmp_path):
    with pytest.raises(fabrig.RecordingError):
        fabrig.animate(rig, fabrig.demo_take(), tmp_path / "no" / "folder.mcap")
    with pytest.raises(fabrig.InputError, match="wind"):
        fabrig.animate(rig, fabrig.demo_take(), tmp_path / "a.mcap", wind=[1, 2])
    assert not list(tmp_path.iterdir())


def test_the_template_is_what_normalized_faces_are_in(rig):
    template = fabrig.template()
    vertices = template.mesh.vertices
    assert vertices.shape == rig.normalized.shape
    assert len(template.regions) == len(vertices)
    left, right = (vertices[template.landmarks[f"lip_corner_{side}"]] for side in "lr")
    assert left[0] > 0 > right[0]
    scale = np.cbrt(np.linalg.det(rig.to_head[:3, :3]))
    assert np.isclose(scale, rig.millimetres_per_unit)
    placed = rig.mesh.vertices @ rig.to_head[:3, :3].T + rig.to_head[:3, 3]
    tip = rig.normalized[template.landmarks["nose_tip"]]
    assert np.linalg.norm(placed - tip, axis=1).min() < 3.0
