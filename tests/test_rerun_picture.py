"""What a person sees who opens a recording in Rerun: a face, and one that moves.

The real viewer draws without a window (`rerun --headless`), on whatever Vulkan there is: a graphics
card, or Mesa's software (`mesa-vulkan-drivers`). Without Vulkan there is no picture to look at and the
picture's test is skipped with the viewer's own words; FABRIG_NEEDS_PICTURES=1 makes that a failure.
"""

import contextlib
import os
import pathlib
import signal
import socket
import subprocess
import sys
import time

import numpy as np
import pytest
from PIL import Image

ROOT = pathlib.Path(__file__).resolve().parent.parent
TARGET = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
TOOLS = pathlib.Path(sys.executable).parent
ENVIRONMENT = dict(
    os.environ, PATH=f"{TOOLS}{os.pathsep}{os.environ['PATH']}", RERUN_ANALYTICS="false"
)
TAKE = "fabrig-keys 1\nfps 30\n0 jawOpen=0\n0.4 jawOpen=0.9 mouthSmile=0.4\n0.5 jawOpen=0.9\n"
PATIENCE = 120
BACKGROUND = np.array([34, 38, 43])
"""The blueprint's."""


def run(*command, **options):
    done = subprocess.run(
        [str(part) for part in command], capture_output=True, text=True, env=ENVIRONMENT, **options
    )
    assert done.returncode == 0, done.stderr
    return done.stdout


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A short recording `take.mcap`, and the script that opens it."""
    folder = tmp_path_factory.mktemp("rerun")
    run("cargo", "build", "--release", "-q", "-p", "fabrig-cli", "--all-features", cwd=ROOT)
    fabrig = TARGET / "release/fabrig"
    (folder / "take.keys").write_text(TAKE)
    quick = ["--without-dynamics", "--record", "weights"]
    run(fabrig, "demo", *quick, "-o", folder / "demo.mcap", "--rig", folder / "face.fabrig")
    take = ["--motion", folder / "take.keys", "-o", folder / "take.mcap"]
    run(fabrig, "animate", folder / "face.fabrig", *take)
    return folder


def free_port():
    with socket.socket() as one:
        one.bind(("127.0.0.1", 0))
        return one.getsockname()[1]


def pictures(folder, times):
    """The viewer's window at some times (s), as arrays; skips where nothing can be drawn."""
    from rerun.experimental import ViewerClient

    run(sys.executable, folder / "open_in_rerun.py", folder / "take.mcap",
        "--save", folder / "take.rbl")  # fmt: skip
    port = free_port()
    log = folder / "viewer.log"
    with open(log, "w") as out:
        viewer = subprocess.Popen(
            ["rerun", folder / "take.mcap", "--headless", "--bind", "127.0.0.1", "--port",
             str(port), "--window-size", "1000x640", "--hide-welcome-screen"],
            env=dict(ENVIRONMENT, XDG_RUNTIME_DIR=str(folder)),
            stdout=out, stderr=subprocess.STDOUT, start_new_session=True,
        )  # fmt: skip
    try:
        end = time.monotonic() + PATIENCE
        client = None
        while True:
            if viewer.poll() is not None or time.monotonic() > end:
                said = log.read_text()
                # Without an adapter, or with OpenGL's software alone.
                cannot = "adapter" in said.lower() or "Failed to get render context" in said
                if "FABRIG_NEEDS_PICTURES" not in os.environ and cannot:
                    pytest.skip(f"the viewer cannot draw here: {said[-300:]}")
                raise AssertionError(said)
            time.sleep(0.5)
            try:
                client = client or ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy")
                state = client.get_state()
            except Exception:  # Not there yet: the loop ends by itself.
                continue
            ends = [t.end or 0 for r in state.recordings for t in r.timelines]
            if not state.loading and max(ends, default=0) >= times[-1] * 1e9:
                break
        subprocess.run(
            ["rerun", folder / "take.rbl", "--port", str(port)],
            env=ENVIRONMENT, capture_output=True, timeout=PATIENCE,
        )  # fmt: skip
        shots = []
        for number, at in enumerate(times):
            client.set_time(
                "message_log_time",
                timestamp=np.datetime64(int(at * 1e9), "ns"),
                play_state="paused",
            )
            time.sleep(4)  # Until it is drawn.
            path = folder / f"shot{number}.png"
            client.save_screenshot(str(path))
            shots.append(np.asarray(Image.open(path).convert("RGB")).astype(int))
        reports = [(v.origin, r.summary) for v in client.get_state().views for r in v.reports]
        assert not reports
        return shots
    finally:
        # It may have left by itself, where it cannot draw.
        with contextlib.suppress(ProcessLookupError):
            os.killpg(viewer.pid, signal.SIGTERM)
        viewer.wait(30)


def test_a_face_is_there_and_moves(folder):
    still, open_ = pictures(folder, [0.0, 0.4])
    height, width = still.shape[:2]
    # The view called Skin is the upper left.
    skin = np.s_[int(0.12 * height) : int(0.62 * height), : width // 2]
    for shot in (still, open_):
        is_face = np.abs(shot[skin] - BACKGROUND).max(axis=2) > 24
        assert 0.1 < is_face.mean() < 0.6
        # Skin is redder than blue, and shaded: not one flat colour.
        colors = shot[skin][is_face]
        assert np.mean(colors[:, 0] > colors[:, 2] + 10) > 0.7
        assert colors.sum(axis=1).std() > 30
        # About as much on the left as on the right: a head seen from the front.
        columns = np.flatnonzero(is_face.any(axis=0))
        middle = (columns[0] + columns[-1]) // 2
        left, right = is_face[:, :middle].sum(), is_face[:, middle:].sum()
        assert 0.8 < left / right < 1.25
    changed = np.abs(still[skin] - open_[skin]).max(axis=2) > 20
    rows = np.flatnonzero(changed.any(axis=1))
    assert changed.mean() > 0.005
    # What moves is the lower face.
    lower = changed[changed.shape[0] // 2 :].sum()
    assert lower > 3 * changed[: changed.shape[0] // 2].sum(), rows


def test_a_recording_converts_to_rerun_s_own_file_whole_or_not_at_all(folder):
    fabrig = TARGET / "release/fabrig"
    run(fabrig, "convert", folder / "take.mcap", "--to", "rrd")
    printed = run("rerun", "rrd", "print", folder / "take.rrd")
    for topic in ("/rig/skin", "/rig/patches", "/weights", "/tf"):
        assert topic in printed
    before = (folder / "take.rrd").read_bytes()
    bad = folder / "bad.mcap"
    bad.write_bytes((folder / "take.mcap").read_bytes()[:1000])
    done = subprocess.run(
        [fabrig, "convert", bad, "-o", folder / "take.rrd"],
        capture_output=True, text=True, env=ENVIRONMENT,
    )  # fmt: skip
    assert done.returncode == 1 and "bad.mcap" in done.stderr
    assert (folder / "take.rrd").read_bytes() == before
    assert not [p for p in folder.iterdir() if p.name.startswith(".fabrig-")]
