"""All of fabrig's Python in one file: run by the tests, and checked by mypy and pyright."""

from __future__ import annotations

import pickle
from pathlib import Path

import fabrig
import numpy as np
from numpy.typing import NDArray

SMILE = "zygomaticus_major_l.mouthSmileLeft"


def meshes(rig: fabrig.Rig, folder: Path) -> None:
    square = fabrig.Mesh(
        [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]],
        [[0, 1, 2, 3]],
        uvs=([[0, 0], [1, 0], [1, 1], [0, 1]], [0, 1, 2, 3]),
        groups=[("all", (0, 1))],
    )
    uvs = square.uvs
    assert uvs is not None and uvs[0].shape == (4, 2) and uvs[1].tolist() == [0, 1, 2, 3]
    assert square.groups == [("all", (0, 1))] and len(square) == 4
    counts, corners = square.polygons
    assert counts.tolist() == [4] and corners.tolist() == [0, 1, 2, 3]
    assert np.array_equal(square.normals, np.tile([0.0, 0.0, 1.0], (4, 1)))
    raised = square.with_vertices(square.vertices + [0, 0, 1])
    raised.write_obj(folder / "square.obj")
    again = fabrig.read_mesh(folder / "square.obj")
    assert again.faces == [[0, 1, 2, 3]] and again.triangles.shape == (2, 3)
    assert fabrig.read_shapes(folder / "square.obj") == {}
    assert np.array_equal(fabrig.Mesh.of(folder / "square.obj").vertices, raised.vertices)
    assert fabrig.Mesh.of((square.vertices, square.faces)).faces == square.faces
    assert len(fabrig.Mesh.of(rig)) == len(rig.mesh)
    copy = pickle.loads(pickle.dumps(square))
    assert copy.groups == square.groups and np.array_equal(copy.vertices, square.vertices)


def registering(rig: fabrig.Rig, folder: Path) -> None:
    face = fabrig.demo_face()
    names = fabrig.template().landmarks
    # The demo face has its own places for what the template names: here, from the rig.
    to_head = rig.to_head
    places = {
        name: (np.linalg.inv(to_head) @ np.append(rig.normalized[names[name]], 1))[:3].tolist()
        for name in ("nose_tip", "menton", "lip_corner_l", "lip_corner_r", "eye_inner_l")
    }
    seen: list[tuple[str, float]] = []
    registered: fabrig.Registration = fabrig.register(
        face,
        landmarks=places,
        min_confidence=0.1,
        progress=lambda stage, share: seen.append((stage, share)),
    )
    report = registered.report
    assert report["used_landmarks"] and report["template_to_face"]["median"] < 0.2
    assert registered.mesh.vertices.shape == (4242, 3)
    assert np.allclose(registered.to_head, to_head, rtol=0.01, atol=0.5)
    assert np.nanmedian(registered.distances) < 0.3
    assert registered.is_part.sum() == np.isnan(registered.distances).sum() > 0
    assert seen and 0 <= seen[0][1] <= seen[-1][1] <= 1


def rigs(rig: fabrig.Rig, folder: Path) -> None:
    rig.save(folder / "face.fabrig")
    loaded = fabrig.Rig.load(folder / "face.fabrig", edits=False)
    assert loaded.template == "human" == fabrig.template().name and fabrig.__version__
    assert np.array_equal(loaded.normalized, rig.normalized)
    assert pickle.loads(pickle.dumps(rig)).alphas == rig.alphas
    assert rig.node_count == sum(rig.patch(name)[..., 0].size for name in rig.patch_names)
    assert rig.shape_names == list(fabrig.ARKIT_SHAPES)
    assert rig.millimetres_per_unit > 900 and rig.report["coverage"] > 0.9
    assert set(rig.parts) >= {"eye_l", "eye_r", "upper_teeth"}
    assert rig.regions.count(None) == sum(len(part) for part in rig.parts.values())
    assert rig.weights({"jawOpen": 0.5, "mouth_smile": 1}).sum() == 2.5
    assert len(rig.expressions("emotions")) == 12
    assert rig.check(gates={"leak_mm": 1.0})["passes"]


def edits(rig: fabrig.Rig, folder: Path) -> None:
    stronger = fabrig.Edits({"shapes": {SMILE: {"strength": 1.4}}})
    path = fabrig.Edits.path_of(folder / "face.fabrig")
    stronger.save(path)
    assert fabrig.Edits.beside(folder / "face.fabrig") == stronger == fabrig.Edits.load(path)
    assert "strength = 1.4" in stronger.to_text() and len(stronger) == 1
    assert pickle.loads(pickle.dumps(stronger)).to_dict() == stronger.to_dict()
    assert SMILE in rig.muscle_shapes
    shape = rig.muscle_shape(SMILE)
    rest = rig.patch("zygomaticus_major_l").reshape(-1, 3)
    motion = shape.vertices - rest
    for given in (stronger, stronger.to_dict(), path):
        edited = rig.with_edits(given).muscle_shape(SMILE).vertices
        assert np.allclose(edited, rest + 1.4 * motion, atol=1e-3)
    assert "looser_skin" in fabrig.Edits.presets()
    fuller = rig.with_edits({"preset": ["more_fat"]})
    more = fuller.patch("malar_fat_l") - rig.patch("malar_fat_l")
    assert 1 < np.linalg.norm(more, axis=-1).max() < 4
    sculpted = fabrig.Edits()
    assert sculpted.sculpt(rig, SMILE, shape.with_vertices(shape.vertices + [0, 2, 0])) == 420
    moved = rig.with_edits(sculpted).muscle_shape(SMILE).vertices
    assert np.allclose(moved, shape.vertices + [0, 2, 0], atol=1e-3)


def takes(rig: fabrig.Rig, folder: Path) -> None:
    clip = fabrig.demo_take()
    clip.save(folder / "take.csv")
    read = fabrig.read_motion(
        folder / "take.csv",
        format="arkit",
        gains={"jawOpen": 0.5},
        swap_sides=True,
        keep_mouth_close=True,
        resample=30,
    )
    assert np.isclose(read.frame_rate or 0, 30) and read.notes["clamped_weights"] == 0
    keyed = fabrig.parse_motion("0 jawOpen=0\n1 jawOpen=0.5 head.yaw=20 wind.x=3")
    assert keyed.channels and keyed.head is not None and keyed.wind is not None
    assert np.isclose(keyed.head[-1, 0], np.radians(20)) and keyed.wind[-1, 0] == 3000
    part = clip.between(1, 2)
    assert part.times[0] >= 1 and part.duration <= 1 and len(part) <= len(clip)
    assert np.array_equal(part.weights[0], clip.sample(float(part.times[0])))
    assert np.array_equal(pickle.loads(pickle.dumps(clip)).weights, clip.weights)
    head = np.zeros((2, 6))
    made = fabrig.Clip(
        [0, 1], ["jawOpen"], [[0], [1]], head=head, eyes=np.ones((2, 4)), wind=np.ones((2, 3))
    )
    assert made.eyes is not None and np.array_equal(made.eyes, np.ones((2, 4)))
    assert made.head is not None and made.head.shape == (2, 6)
    assert len(made.resampled(10)) == 11 and made.to_csv().startswith("time")
    assert fabrig.action_units()["AU12"] and fabrig.weights_of_units({"AU26.l": 1})["jawOpen"] > 0


def stepping(rig: fabrig.Rig, folder: Path) -> None:
    scene = fabrig.read_scene()
    scene["eyes"] = "tracked"
    scene["wind"] = np.array([0.0, 0.0, 500.0])
    (folder / "scene.toml").write_text("gravity = [0, 0, 0]\n")
    assert fabrig.read_scene(folder / "scene.toml")["gravity"] == [0, 0, 0]
    floating = fabrig.Simulation(rig, scene=folder / "scene.toml", substeps=4, economy="off")
    assert floating.scene["gravity"] == [0, 0, 0] and floating.judge_contact() is None
    simulation = fabrig.Simulation(rig, scene=scene, gravity=[0, -9810, 0])
    rig.save(folder / "ann.fabrig")
    shot = "duration = 0.05\nfps = 40\n[turbulence]\nseed = 3\n[simulate]\nonly = ['frontalis_*']\n"
    for name, place in [("ann", -100), ("bob", 100)]:
        shot += f"[[faces]]\nname = '{name}'\nrig = 'ann.fabrig'\nposition = [{place}, 0, 0]\n"
    (folder / "shot.toml").write_text(shot)
    bob = fabrig.Simulation(scene=folder / "shot.toml", face="bob")
    assert bob.scene["place"]["position"] == [100, 0, 0] and bob.head[0, 3] == 100
    faces = fabrig.animate_scene(folder / "shot.toml", folder / "shot.mcap", record=["skin"])
    assert [(name, report["frames"]) for name, report in faces] == [("ann", 3), ("bob", 3)]
    assert len(list(fabrig.Recording(folder / "shot.mcap", face="bob"))) == 2
    turn = np.eye(4)
    turn[:3, 3] = 0, 100, 0
    report = simulation.step(
        1 / 60, weights={"jawOpen": 1}, head=turn, eyes=[0.2, 0, 0.2, 0], wind=[0, 0, 0]
    )
    assert report["time"] == simulation.time == 1 / 60
    assert np.allclose(simulation.head, turn) and simulation.rig.node_count == rig.node_count
    simulation.hold(weights=rig.weights({"jawOpen": 0.3}))
    assert simulation.settle_error[0] < 0.3
    assert np.isclose(simulation.weights[rig.shape_names.index("jawOpen")], 0.3)
    out = np.empty((len(rig.mesh), 3), np.float32)
    assert simulation.vertices_into(out) is out
    assert np.allclose(out, simulation.vertices, atol=1e-4)
    assert simulation.skin.shape == out.shape
    assert simulation.patch("masseter_l").shape == (420, 3)
    simulation.reset()
    assert np.abs(simulation.vertices - rig.mesh.vertices).max() * rig.millimetres_per_unit < 0.01


def contact(rig: fabrig.Rig, folder: Path) -> None:
    tip = rig.normalized[fabrig.template().landmarks["nose_tip"]]
    demo = fabrig.demo_scene()
    assert demo["contact"]["pairs"] == "all" and fabrig.demo_take(story="contact").duration > 1
    ball = {"name": "ball", "shape": {"type": "ball", "radius": 10.0}, "keys": [{"time": 0.0, "position": [0.0, 0.0, 300.0]}]}
    scene = {"contact": {"pairs": "sphincter"}, "colliders": [ball]}
    simulation = fabrig.Simulation(rig, scene=scene)
    for step in range(3):
        simulation.set_collider("ball", tip + [0, 0, 40 - step], rotation=[0, 0.1, 0])
        simulation.step(1 / 120, weights={})
    assert simulation.contact is not None and simulation.contact_points.shape[1] == 3
    assert simulation.collider_forces["ball"].shape == (3,)
    verdict = simulation.judge_contact()
    assert verdict is not None and verdict["colliders"] == 0


def recording(rig: fabrig.Rig, folder: Path) -> None:
    clip = fabrig.demo_take().between(0, 0.2)
    report = fabrig.animate(
        rig,
        clip,
        folder / "out.mcap",
        fps=30,
        skin_hz=30,
        patches_hz=0,
        points_hz=0,
        strain_hz=0,
        record=["skin", "weights", "errors"],
        rig_name="sample",
        take_name="a bit",
        layout=folder / "layout.json",
        progress=None,
    )
    assert report["is_complete"] and (folder / "layout.json").stat().st_size > 100
    topics = {topic["topic"] for topic in report["recording"]["topics"]}
    assert "/weights" in topics and not any("patches" in topic for topic in topics)
    try:
        fabrig.animate(rig, clip, folder / "none.mcap", record=["smell"])
    except fabrig.InputError as error:
        assert "record: 'smell' is not one of skin" in str(error)
    else:
        raise AssertionError("smells cannot be recorded")
    reader = fabrig.Recording(folder / "out.mcap", recover=True)
    assert reader.metadata["rig"] == "sample"
    frames = list(reader)
    assert len(frames) == report["frames"] and frames[0].time == 0
    first: fabrig.RecordedFrame = frames[0]
    assert first.patch_names == [] and first.head.shape == (4, 4)
    assert first.surfaces["skin"].shape[1] == 3
    assert first.triangles["skin"].max() < len(first.surfaces["skin"])
    assert first.render(size=32).shape == (32, 32, 3)
    converted = fabrig.convert(
        folder / "out.mcap", folder / "out.npz", rig=rig, unit="mm", progress=False
    )
    assert converted and (folder / "out.npz").exists()
    exported = rig.export(folder / "face.glb", shapes="targets", check=False, unit="m")
    assert exported and set(fabrig.read_shapes(folder / "face.glb")) == set(rig.shape_names)


def retargeting(rig: fabrig.Rig, folder: Path) -> None:
    simulation = fabrig.Simulation(rig, dynamics=False)
    frames: list[NDArray[np.float64]] = []
    for weight in (0.0, 0.2, 0.4):
        simulation.reset(weights={"jawOpen": weight})
        frames.append(simulation.vertices)
    take, report = fabrig.retarget(np.stack(frames), rig, units=[26, 12], still_head=True, fps=10)
    assert report["residual_rms"] < 1 and report["controls"][0].startswith("AU26")
    assert report["values"].shape == (3, len(report["controls"]))
    jaw = take.weights[:, take.channels.index("jawOpen")]
    assert np.allclose(jaw, [0, 0.2, 0.4], atol=0.03)


def pictures(rig: fabrig.Rig, folder: Path) -> None:
    mesh = rig.mesh.render(view="three-quarter", size=48, edges=True)
    posed = rig.render({"jawOpen": 1}, size=48, zoom="face", dynamics=False)
    assert (rig.render(size=48, zoom="face", dynamics=False) != posed).any()
    muscles = rig.render(view="20,10", size=48, patches=True, names=True, dynamics=False)
    template = fabrig.template()
    drawn = template.render({"mouthSmile": 1}, size=48, zoom="mouth")
    now = fabrig.Simulation(rig, dynamics=False).render(size=48, view="side", edges=True)
    assert muscles.shape == (48, 76, 3)
    all_of_them = [mesh, posed, drawn, now]
    assert all(p.shape == (48, 48, 3) and p.std() > 5 for p in all_of_them)
    fabrig.write_png(folder / "face.png", posed)
    fabrig.write_gif(folder / "faces.gif", all_of_them, fps=4)
    assert (folder / "face.png").read_bytes()[:4] == b"\x89PNG"
    assert (folder / "faces.gif").read_bytes()[:3] == b"GIF"


def templates(rig: fabrig.Rig, folder: Path) -> None:
    template: fabrig.Template = fabrig.template()
    assert template.shape_names == rig.shape_names and "CC0" in template.credit
    assert len(template.regions) == len(template.mesh)
    assert np.abs(template.shape("jawOpen")).max() > 20
    itself = template.rig()
    assert len(itself.mesh) == len(template.mesh)
    assert template.check(gates={"leak_mm": 1.0})["passes"]
    try:
        fabrig.Template.load(folder)
    except fabrig.TemplateError:
        pass
    else:
        raise AssertionError("an empty folder is no template")
    try:
        fabrig.Template.build(folder, folder / "mine", name="mine", credit="me")
    except fabrig.TemplateError as error:
        assert "neutral" in str(error)
    else:
        raise AssertionError("a folder without a neutral is no rig")


def cloth(rig: fabrig.Rig, folder: Path) -> None:
    v, u = np.mgrid[0:8, 0:10] * 2.0
    sheet = np.stack([u, v, 0 * u], axis=-1)
    patch = fabrig.Cloth([sheet], material="fat", substeps=4)
    patch.reset([sheet])
    report = patch.step(1 / 60, [sheet + [0, 1, 0]])
    assert report["milliseconds"] > 0 and patch.patch_count == 1
    assert patch.positions[0].shape == (8, 10, 3)


def measuring(rig: fabrig.Rig, folder: Path) -> None:
    bench = fabrig.bench
    report = bench.pareto(
        rig, fabrig.demo_take(), frames=4, substeps=[8], reference_substeps=32, progress=None
    )
    assert {point["substeps"] for point in report["points"]} == {8}
    stopped: list[str] = []

    def stop(what: str, share: float) -> None:
        stopped.append(what)
        raise KeyboardInterrupt

    # Long ones are stopped at their first word.
    for measure in (
        lambda: bench.runtime(rig, frames=10, progress=stop),
        lambda: bench.stability(rig, progress=stop),
        lambda: bench.table3(methods=["delta"], progress=stop),
        lambda: bench.registration(progress=stop),
        lambda: bench.registration_cost(largest=1000, progress=stop),
    ):
        try:
            measure()
        except KeyboardInterrupt:
            continue
        raise AssertionError("nothing stopped it")
    assert len(stopped) == 5


PARTS = [
    meshes,
    registering,
    rigs,
    edits,
    takes,
    stepping,
    contact,
    recording,
    retargeting,
    pictures,
    templates,
    cloth,
    measuring,
]
