"""How long calls behave: progress, Ctrl-C, other threads; and what survives a pickle."""

import copy
import io
import pickle
import signal
import subprocess
import sys
import textwrap
import threading
import time

import fabrig
import numpy as np
import pytest
from fabrig._progress import Bar


def test_other_threads_run_while_a_face_is_rigged(face):
    count, stop = 0, threading.Event()

    def tick():
        nonlocal count
        while not stop.is_set():
            count += 1
            time.sleep(0.005)

    thread = threading.Thread(target=tick)
    thread.start()
    fabrig.rig(face)
    stop.set()
    thread.join()
    assert count > 20


@pytest.mark.parametrize(
    "work",
    [
        "fabrig.rig(fabrig.demo_face())",
        "fabrig.animate(rig, fabrig.demo_take(), 'out.mcap')",
        "fabrig.retarget(np.stack([rig.mesh.vertices] * 400), rig)",
        "fabrig.bench.pareto(rig, frames=None)",
        "fabrig.bench.chain(cloth=True)",
        "rig.check(contact=True)",
        "rig.export('face.glb')",
    ],
)
def test_ctrl_c_stops_it(work, rig, tmp_path):
    rig.save(tmp_path / "face.fabrig")
    program = f"""
        import numpy as np, signal, sys, fabrig
        # What runs in the background of a shell is started deaf to it.
        signal.signal(signal.SIGINT, signal.default_int_handler)
        rig = fabrig.Rig.load("face.fabrig")
        print("ready", flush=True)
        try:
            while True:
                {work}
        except KeyboardInterrupt:
            sys.exit(77)
    """
    child = subprocess.Popen(
        [sys.executable, "-c", textwrap.dedent(program)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        cwd=tmp_path,
    )
    try:
        assert child.stdout.readline() == b"ready\n"
        time.sleep(0.3)
        child.send_signal(signal.SIGINT)
        _, errors = child.communicate(timeout=30)
    finally:
        child.kill()
    assert child.returncode == 77, errors.decode()


def test_a_bar_shows_how_far_things_are(face, capsys):
    fabrig.rig(face, progress=True)
    shown = capsys.readouterr().err
    assert "align" in shown and "build" in shown and "%" in shown
    fabrig.rig(face, progress=False)
    assert capsys.readouterr().err == ""
    with pytest.raises(fabrig.InputError, match="progress"):
        fabrig.rig(face, progress=3)


def test_a_bar_is_drawn_over_on_terminals(monkeypatch):
    class Terminal(io.StringIO):
        def isatty(self):
            return True

    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    bar = Bar()
    bar("rig", 0.5)
    bar("rig", 1.0)
    bar.close()
    text = terminal.getvalue()
    assert "\n" not in text and text.count("rig:") == 2 and "100%" in text and text.endswith("\r")


def test_pickles_hold_everything(rig, face):
    assert copy.deepcopy(face).groups == face.groups
    again = pickle.loads(pickle.dumps(rig))
    assert again.report == rig.report and np.array_equal(again.to_head, rig.to_head)
    clip = fabrig.parse_motion("0 jawOpen=0\n1 jawOpen=1 head.yaw=10 wind.x=1")
    loaded = pickle.loads(pickle.dumps(clip))
    for of in ("times", "weights", "head", "wind"):
        assert np.array_equal(getattr(loaded, of), getattr(clip, of)), of
    assert loaded.notes == clip.notes and loaded.channels == clip.channels
    for kind in (fabrig.Mesh, fabrig.Clip, fabrig.Rig):
        with pytest.raises(fabrig.FabrigError):
            kind._from_bytes(b"damaged")


def test_pictures_and_outputs_are_refused_by_name(rig, tmp_path):
    simulation = fabrig.Simulation(rig, dynamics=False)
    for out in (np.empty((3, 3)), np.empty((len(rig.mesh), 3), int), "text"):
        with pytest.raises(fabrig.InputError, match="out:"):
            simulation.vertices_into(out)
    for options in ({"size": 3}, {"zoom": "ear"}):
        with pytest.raises(fabrig.InputError):
            rig.render(**options)
    with pytest.raises(fabrig.RenderError, match="unknown view"):
        rig.mesh.render(view="inside")
    with pytest.raises(fabrig.InputError, match="pose: .*jawOpen"):
        rig.render({"jawOpne": 1})
    with pytest.raises(fabrig.InputError, match="head: expected a rigid motion"):
        simulation.step(0.1, head=np.eye(4) * 2)
    with pytest.raises(fabrig.RenderError):
        fabrig.write_gif(tmp_path / "none.gif", [])
    with pytest.raises(fabrig.InputError, match="scene: not made of plain values"):
        fabrig.Simulation(rig, scene={"gravity": object()})


def test_errors_have_a_kind(rig, tmp_path):
    assert issubclass(fabrig.EditError, fabrig.RigError)
    with pytest.raises(fabrig.EditError, match="zygomaticus"):
        rig.with_edits({"shapes": {"zygomaticus_major_l.mouthSmileLft": {"strength": 2}}})
    with pytest.raises(fabrig.EditError, match="none.toml"):
        rig.with_edits(tmp_path / "none.toml")
    with pytest.raises(fabrig.SceneError, match="none.toml"):
        fabrig.read_scene(tmp_path / "none.toml")
    with pytest.raises(fabrig.LandmarkError):
        fabrig.register(rig, landmarks=np.zeros((5, 3)))
    with pytest.raises(fabrig.RegistrationError):
        fabrig.register(fabrig.Mesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]))
    with pytest.raises(fabrig.RetargetError, match="nothing.npy"):
        fabrig.retarget(tmp_path / "nothing.npy", rig)
    with pytest.raises(fabrig.MotionError, match="none.c3d"):
        fabrig.retarget(tmp_path / "none.c3d", rig)
    with pytest.raises(fabrig.RecordingError):
        fabrig.Recording(tmp_path / "none.mcap")
    with pytest.raises(fabrig.InputError, match="ratio"):
        fabrig.bench.pareto(ratio=-1)
    with pytest.raises(fabrig.ClothError):
        fabrig.Cloth([np.zeros((2, 2, 3))], substeps=0)
    with pytest.raises(fabrig.CheckError):
        raise fabrig.CheckError("rigs of other templates are refused elsewhere")
    with pytest.raises(fabrig.ExportError):
        rig.export(tmp_path / "face.docx")
