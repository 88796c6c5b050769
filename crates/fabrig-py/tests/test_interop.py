"""Meshes of other packages in and out; faces in Rerun."""

import subprocess
import sys

import fabrig
import numpy as np
import pytest


@pytest.fixture
def small():
    return fabrig.Mesh(
        [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [2, 0, 0], [2, 1, 0], [3, 0.5, 0]],
        [[0, 1, 2, 3], [1, 4, 2], [4, 6, 5, 2, 1]],
    )


def test_trimesh_in_and_out(face):
    trimesh = pytest.importorskip("trimesh")
    there = face.to_trimesh()
    assert isinstance(there, trimesh.Trimesh)
    back = fabrig.Mesh.of(there)
    assert np.array_equal(back.vertices, face.vertices)
    assert np.array_equal(back.triangles, face.triangles)
    visual = trimesh.visual.TextureVisuals(uv=np.random.default_rng(1).random((len(face), 2)))
    textured = trimesh.Trimesh(face.vertices, face.triangles, visual=visual, process=False)
    uvs = fabrig.Mesh.of(textured).uvs
    assert np.allclose(uvs[0][uvs[1]], np.float32(textured.visual.uv)[face.triangles.ravel()])
    assert fabrig.register(there).report["template_to_face"]["median"] < 0.2


def test_meshio_in_and_out(small, tmp_path):
    meshio = pytest.importorskip("meshio")
    there = small.to_meshio()
    assert {block.type for block in there.cells} == {"triangle", "quad", "polygon"}
    back = fabrig.Mesh.of(there)
    assert np.array_equal(back.vertices, small.vertices)
    assert sorted(map(tuple, back.faces)) == sorted(map(tuple, small.faces))
    there.write(tmp_path / "face.ply", binary=False)
    assert len(fabrig.Mesh.of(meshio.read(tmp_path / "face.ply"))) == len(small)
    lines = meshio.Mesh(small.vertices, [("line", np.array([[0, 1]]))])
    with pytest.raises(fabrig.InputError, match="only line"):
        fabrig.Mesh.of(lines)


def test_pyvista_in_and_out(small, tmp_path):
    pyvista = pytest.importorskip("pyvista")
    there = small.to_pyvista()
    assert isinstance(there, pyvista.PolyData) and there.n_points == 7
    back = fabrig.Mesh.of(there)
    assert back.faces == small.faces and np.array_equal(back.vertices, small.vertices)


def test_a_face_is_plotted_off_screen(face, tmp_path):
    pytest.importorskip("pyvista")
    # A machine without any way to draw ends the process: another one tries it.
    program = """
import fabrig, numpy as np
face = fabrig.demo_face()
face.plot(off_screen=True, screenshot="plain.png", window_size=(96, 96))
face.plot(scalars=face.vertices[:, 1], off_screen=True, screenshot="face.png", window_size=(96, 96))
print(fabrig.Mesh.of(face.to_pyvista()))
"""
    run = subprocess.run(
        [sys.executable, "-c", program], cwd=tmp_path, capture_output=True, text=True
    )
    if run.returncode < 0 or (run.returncode and "X server" in run.stderr):
        pytest.skip("pyvista cannot draw here")
    assert run.returncode == 0, run.stderr
    assert (tmp_path / "face.png").stat().st_size > 500
    with pytest.raises(fabrig.InputError, match="scalars"):
        face.plot(scalars=[1, 2])


def test_what_is_no_mesh_is_refused():
    for bad in (3, object(), {"vertices": []}):
        with pytest.raises(fabrig.InputError, match="mesh: expected"):
            fabrig.Mesh.of(bad)


def test_extras_are_imported_when_they_are_used():
    program = (
        "import sys, fabrig; fabrig.demo_face(); "
        "print([m for m in ('trimesh', 'meshio', 'pyvista', 'rerun') if m in sys.modules])"
    )
    run = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True)
    assert run.stdout.strip() == "[]", run.stderr


def test_a_missing_extra_says_how_to_install_it(monkeypatch, face):
    monkeypatch.setitem(sys.modules, "trimesh", None)
    with pytest.raises(ImportError, match=r"pip install 'fabrig\[trimesh\]'"):
        face.to_trimesh()
    monkeypatch.setitem(sys.modules, "rerun", None)
    with pytest.raises(ImportError, match=r"'fabrig\[rerun\]', or pip install rerun-sdk"):
        fabrig.log_to_rerun("out.mcap")


def test_faces_go_to_rerun(rig, tmp_path):
    rerun = pytest.importorskip("rerun")
    stream = rerun.RecordingStream("fabrig_test")
    path = tmp_path / "face.rrd"
    stream.save(path)
    simulation = fabrig.Simulation(rig, fabrig.demo_take())
    for _ in range(2):
        simulation.step(1 / 60)
        assert fabrig.log_to_rerun(simulation, patches=True, recording=stream) == 1
    fabrig.animate(rig, fabrig.demo_take().between(0, 0.1), tmp_path / "out.mcap", fps=30)
    count = fabrig.log_to_rerun(tmp_path / "out.mcap", "again", recording=stream)
    assert count == 4
    stream.flush()
    stream.disconnect()
    rrd = subprocess.run(
        [sys.executable, "-m", "rerun", "rrd", "print", path], capture_output=True, text=True
    )
    shown = rrd.stdout + rrd.stderr
    for entity in ("/face/skin", "/face/weights", "/face/patches/masseter_l", "/again/skin"):
        assert entity in shown, entity
