"""Scenes from Python: what is wrong with one is told, and what one says reaches the face."""

import fabrig
import numpy as np
import pytest


def test_files_are_refused_with_line_column_and_the_nearest_name(rig, tmp_path):
    path = tmp_path / "shot.toml"
    for text, said in [
        ("fps = 30\n[contact]\n  frction = 1\n", r"line 3, column 3: `frction`.*mean `friction`"),
        ("[cloth]\nsubsteps = 0\n", r"line 2, column 12: `cloth.substeps`.*from 1 to 4096, found 0"),
        ("[simulate]\nonly = ['malar_fat_k']\n", r"line 2, column 9.*mean `malar_fat_."),
    ]:
        path.write_text(text)
        with pytest.raises(fabrig.SceneError, match=said):
            fabrig.Simulation(rig, scene=path)
    with pytest.raises(fabrig.SceneError, match="`gravty` is no key of a scene.*`gravity`"):
        fabrig.Simulation(rig, scene={"gravty": [0, 0, 0]})
    with pytest.raises(fabrig.SceneError, match=r"`wind.keys\[1\].time`"):
        keys = [{"time": 1, "value": [0, 0, 0]}, {"time": 0, "value": [0, 0, 0]}]
        fabrig.Simulation(rig, scene={"wind": {"keys": keys}})


def test_what_is_read_is_taken_again(tmp_path):
    path = tmp_path / "shot.toml"
    path.write_text("[turbulence]\nseed = 4\n[simulate]\nexcept = ['*_fat_*']\n")
    scene = fabrig.read_scene(path)
    assert scene["turbulence"]["seed"] == 4 and scene["simulate"]["except"] == ["*_fat_*"]
    assert scene["forces"] == [] and scene["shake"] is None and scene["head_motion"] is True


def test_head_keys_move_the_head_whatever_weights_are_given(rig):
    keys = [{"time": 0}, {"time": 1, "position": [0, 100, 0]}]
    simulation = fabrig.Simulation(rig, scene={"head_motion": {"keys": keys}})
    for _ in range(30):
        simulation.step(1 / 60, weights={"jawOpen": 0.2})
    assert np.allclose(simulation.head[:3, 3], [0, 50, 0], atol=1e-6)
    for _ in range(6):
        simulation.step(1 / 60)
    assert 60 < simulation.head[1, 3] < 70 and simulation.weights.max() > 0.19


def test_faces_of_a_scene_are_chosen_by_name(rig, tmp_path):
    rig.save(tmp_path / "ann.fabrig")
    face = "[[faces]]\nname = '{}'\nrig = 'ann.fabrig'\nturn = [{}, 0, 0]\n"
    path = tmp_path / "shot.toml"
    path.write_text("duration = 0.1\n" + face.format("ann", 0) + face.format("bob", -np.pi / 2))
    with pytest.raises(fabrig.InputError, match="several: ann, bob"):
        fabrig.Simulation(scene=path)
    with pytest.raises(fabrig.InputError, match="'eve' is not one of ann, bob"):
        fabrig.Simulation(scene=path, face="eve")
    with pytest.raises(fabrig.SceneError, match="2 faces of its own"):
        fabrig.Simulation(rig, scene=path)
    with pytest.raises(fabrig.InputError, match="no faces"):
        fabrig.Simulation(scene={})
    ann, bob = (fabrig.Simulation(scene=path, face=name) for name in ("ann", "bob"))
    for _ in range(20):
        ann.step(1 / 60)
        bob.step(1 / 60)
    # Ann stands as she was captured; bob lies on his back and sags.
    assert ann.settle_error[1] < 1e-3 and bob.settle_error[1] > 1
    report = fabrig.animate_scene(path, tmp_path / "shot.mcap", fps=20, record=["skin"])
    assert [(name, face["frames"]) for name, face in report] == [("ann", 3), ("bob", 3)]
    with pytest.raises(fabrig.RecordingError, match="ann, bob"):
        fabrig.Recording(tmp_path / "shot.mcap")
    assert fabrig.Recording(tmp_path / "shot.mcap", face="bob").metadata["faces"] == "ann,bob"
