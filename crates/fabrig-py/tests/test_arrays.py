"""What is refused at the border, and that memory layout does not matter."""

import fabrig
import numpy as np
import pytest

SQUARE = np.array([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]], float)


@pytest.mark.parametrize("order", ["C", "F"])
@pytest.mark.parametrize("dtype", [np.float32, np.float64, np.int64])
def test_layout_and_type_do_not_matter(order, dtype):
    mesh = fabrig.Mesh(np.asarray(SQUARE, dtype, order=order), [[0, 1, 2, 3]])
    assert np.array_equal(mesh.vertices, SQUARE)
    assert mesh.faces == [[0, 1, 2, 3]]
    assert np.array_equal(mesh.triangles, [[0, 1, 2], [0, 2, 3]])


def test_outputs_are_copies():
    mesh = fabrig.Mesh(SQUARE, [[0, 1, 2]])
    mesh.vertices[0] = 9
    assert np.array_equal(mesh.vertices, SQUARE)


@pytest.mark.parametrize(
    "vertices, faces, error, words",
    [
        (np.zeros((10, 2)), [[0, 1, 2]], fabrig.InputError, r"vertices: expected shape \(N, 3\), got \(10, 2\)"),
        (np.zeros(9), [[0, 1, 2]], fabrig.InputError, "vertices"),
        ("text", [[0, 1, 2]], fabrig.InputError, "vertices"),
        (SQUARE, np.zeros((1, 3)), fabrig.InputError, "faces: expected whole numbers"),
        (SQUARE, [[0, 1, -1]], fabrig.InputError, "faces: face 0 has the vertex index -1"),
        (SQUARE, np.array([[0, 1, -1]]), fabrig.InputError, "faces: face 0 has the vertex index -1"),
        (SQUARE, [[0, 1, 4]], fabrig.MeshError, "vertex 4"),
        (SQUARE, [[0, 1]], fabrig.MeshError, "2 corners"),
        (SQUARE, [], fabrig.MeshError, "0 faces"),
        (SQUARE * np.nan, [[0, 1, 2]], fabrig.MeshError, "not a finite number"),
    ],
)
def test_bad_meshes(vertices, faces, error, words):
    with pytest.raises(error, match=words):
        fabrig.Mesh(vertices, faces)


def test_clips_are_checked():
    clip = fabrig.Clip([0.0, 1.0], ["jawOpen"], [[0.0], [1.0]])
    assert len(clip) == 2 and clip.duration == 1.0
    assert clip.sample(1.0) == [1.0]
    with pytest.raises(fabrig.InputError, match=r"weights: expected shape \(2, 1\), got \(1, 1\)"):
        fabrig.Clip([0.0, 1.0], ["jawOpen"], [[0.0]])
    with pytest.raises(fabrig.MotionError, match="outside|lie in"):
        fabrig.Clip([0.0], ["jawOpen"], [[2.0]])


def test_every_error_is_a_fabrig_error():
    errors = [getattr(fabrig, name) for name in fabrig.__all__ if name.endswith("Error")]
    assert len(errors) == 17
    assert all(issubclass(error, fabrig.FabrigError) for error in errors)


def test_missing_files_are_typed(tmp_path):
    with pytest.raises(fabrig.MeshError, match="cannot read"):
        fabrig.read_mesh(tmp_path / "none.obj")
    with pytest.raises(fabrig.MotionError, match="cannot read"):
        fabrig.read_motion(tmp_path / "none.csv")
    with pytest.raises(fabrig.RigError, match="none.fabrig"):
        fabrig.Rig.load(tmp_path / "none.fabrig")
