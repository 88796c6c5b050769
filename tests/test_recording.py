"""Recordings as independent readers see them.

Needs `pip install mcap mcap-protobuf-support pymcap-cli rerun-sdk numpy pytest`. The file under
test is FABRIG_RECORDING, or one that the `record_synthetic` example writes. A missing package or
a missing Rust toolchain fails the tests: nothing here is skipped.
"""

import math
import os
import pathlib
import subprocess
import sys

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

ROOT = pathlib.Path(__file__).resolve().parent.parent
STEP_UNITS = 2.0**-13
MESHES = ["/rig/skin", "/rig/parts", "/rig/patches"]
CLOUDS = {"/rig/skin": "/points/skin", "/rig/patches": "/points/patches"}


def run(*command):
    """Runs a tool that stands beside this interpreter or on the path."""
    folder = pathlib.Path(sys.executable).parent
    environment = dict(os.environ, PATH=f"{folder}{os.pathsep}{os.environ['PATH']}")
    return subprocess.run(
        [str(part) for part in command], capture_output=True, text=True, env=environment, cwd=ROOT
    )


@pytest.fixture(scope="session")
def recording(tmp_path_factory):
    """The file under test."""
    given = os.environ.get("FABRIG_RECORDING")
    if given:
        return pathlib.Path(given)
    path = tmp_path_factory.mktemp("recording") / "synthetic.mcap"
    made = run(
        "cargo", "run", "--release", "-q", "-p", "fabrig-core",
        "--example", "record_synthetic", "--", path, "2", "24",
    )  # fmt: skip
    assert made.returncode == 0, made.stderr
    return path


@pytest.fixture(scope="session")
def messages(recording):
    """Topic -> list of (log time [ns], decoded message), in file order."""
    found = {}
    with open(recording, "rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for _, channel, message, decoded in reader.iter_decoded_messages():
            found.setdefault(channel.topic, []).append((message.log_time, decoded))
    return found


def test_pymcap_doctor_accepts_it(recording):
    done = run("pymcap-cli", "doctor", recording)
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("command", ["check", "info"])
def test_rerun_accepts_it(recording, command):
    done = run("rerun", "mcap", command, recording)
    assert done.returncode == 0, done.stdout + done.stderr


def test_rerun_refuses_a_cut_one(recording, tmp_path):
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(recording.read_bytes()[: recording.stat().st_size // 2])
    assert run("rerun", "mcap", "check", cut).returncode != 0


def test_every_schema_is_protobuf_and_log_time_rises(recording):
    with open(recording, "rb") as file:
        summary = make_reader(file).get_summary()
    assert {s.encoding for s in summary.schemas.values()} == {"protobuf"}
    assert summary.statistics.message_start_time == 0
    with open(recording, "rb") as file:
        times = [m.log_time for _, _, m in make_reader(file).iter_messages(log_time_order=False)]
    assert times == sorted(times)


def test_it_says_what_it_is_and_carries_its_layout(recording):
    with open(recording, "rb") as file:
        reader = make_reader(file)
        metadata = {m.name: m.metadata for m in reader.iter_metadata()}
        attached = {a.name for a in reader.iter_attachments()}
    assert {"rig", "template", "fps", "version", "seed"} <= metadata["fabrig"].keys()
    assert "fabrig.foxglove.json" in attached


def test_no_topic_is_faster_than_viewers_like(messages):
    end = max(time for series in messages.values() for time, _ in series)
    for topic, series in messages.items():
        if topic != "/log":
            assert len(series) / (end * 1e-9) <= 60.0, topic
    for topic in MESHES:
        # An odd number of frames at 60 a second has a mesh on both its ends.
        assert (len(messages[topic]) - 1) / (end * 1e-9) <= 30.0, topic


@pytest.mark.parametrize("topic", MESHES)
def test_meshes_hold_together(messages, topic):
    first_ids = [entity.id for entity in messages[topic][0][1].entities]
    for _, update in messages[topic]:
        assert [entity.id for entity in update.entities] == first_ids
        before = 0
        for entity in update.entities:
            (surface,) = entity.triangles
            count = len(surface.points)
            indices = np.array(surface.indices).reshape(-1, 3)
            assert entity.frame_id == "head" and not entity.lifetime.nanos
            assert indices.max() < count
            mesh = np.array([(t.a, t.b, t.c) for t in surface.mesh_triangles])
            assert np.array_equal(mesh, indices + before)
            before += count
            assert len(surface.mesh_normals) == len(surface.mesh_colors) == count
    for entity in messages[topic][-1][1].entities:
        (surface,) = entity.triangles
        points = np.array([(p.x, p.y, p.z) for p in surface.points])
        assert np.array_equal(points, np.round(points / STEP_UNITS) * STEP_UNITS)
        lengths = np.linalg.norm([(n.x, n.y, n.z) for n in surface.mesh_normals], axis=1)
        assert np.all((np.abs(lengths - 1) < 0.03) | (lengths == 0))
        # Decimetres: a head is some units high, and no part of it is far away.
        assert np.abs(points).max() < 10


@pytest.mark.parametrize("mesh", CLOUDS)
def test_points_are_the_vertices_of_the_mesh(messages, mesh):
    updates = dict(messages[mesh])
    for time, cloud in messages[CLOUDS[mesh]]:
        assert [f.name for f in cloud.fields] == ["x", "y", "z", "red", "green", "blue", "alpha"]
        data = np.frombuffer(cloud.data, np.uint8).reshape(-1, cloud.point_stride)
        points = data[:, :12].copy().view("<f4")
        if time in updates:
            surfaces = [s for entity in updates[time].entities for s in entity.triangles]
            expected = np.array([(p.x, p.y, p.z) for s in surfaces for p in s.points], "f4")
            assert np.array_equal(points, expected)


def test_transforms_reach_the_root_and_turn_up(messages):
    for _, update in messages["/tf"]:
        parents = {t.child_frame_id: t.parent_frame_id for t in update.transforms}
        assert parents == {"head": "rig", "rig": "world"}
        for transform in update.transforms:
            q = transform.rotation
            assert math.isclose(q.x**2 + q.y**2 + q.z**2 + q.w**2, 1, abs_tol=1e-9)
    upright = messages["/tf"][0][1].transforms[0].rotation
    assert math.isclose(upright.x, math.sqrt(0.5)) and math.isclose(upright.w, math.sqrt(0.5))


@pytest.mark.parametrize("topic", ["/weights", "/stats"])
def test_series_have_named_finite_numbers(recording, messages, topic):
    with open(recording, "rb") as file:
        channels = make_reader(file).get_summary().channels.values()
    (listed,) = (c.metadata["fields"].split(",") for c in channels if c.topic == topic)
    for _, values in messages[topic]:
        assert [field.name for field in values.DESCRIPTOR.fields] == listed
        assert all(math.isfinite(getattr(values, name)) for name in listed)
    if topic == "/weights":
        for name in listed:
            assert all(-1e-6 <= getattr(v, name) <= 1 + 1e-6 for _, v in messages[topic])


def test_the_blueprint_helper_makes_a_blueprint(recording, tmp_path):
    script = ROOT / "crates/fabrig-core/viewers/open_in_rerun.py"
    saved = tmp_path / "view.rbl"
    made = run(sys.executable, script, recording, "--save", saved)
    assert made.returncode == 0, made.stderr
    shown = run("rerun", "rrd", "print", saved)
    assert shown.returncode == 0, shown.stderr
    assert recording.stem in shown.stdout + shown.stderr
