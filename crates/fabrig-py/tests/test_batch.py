"""A batch comes to the same bytes here and on Ray, and loses nothing with a worker."""

import hashlib
import json
import os
import pathlib
import signal
import subprocess
import sys
import threading
import time

import fabrig
import numpy as np
import pytest

EXAMPLES = pathlib.Path(__file__).parents[1] / "examples"

MANIFEST = """
[[faces]]
file = "ann.fabrig"
[[faces]]
file = "bob.obj"
[[takes]]
file = "take.csv"
name = "early"
to = 0.3
[[takes]]
file = "take.csv"
name = "late"
from = 0.3
[[outputs]]
path = "data/{face}/{take}.npz"
content = "dataset"
[[outputs]]
path = "{face}/{take}.mcap"
"""


@pytest.fixture(scope="module")
def work(rig, face, tmp_path_factory):
    folder = tmp_path_factory.mktemp("work")
    rig.save(folder / "ann.fabrig")
    face.write_obj(folder / "bob.obj")
    fabrig.demo_take().between(0.5, 1.1).save(folder / "take.csv")
    (folder / "work.toml").write_text(MANIFEST)
    return folder


@pytest.fixture(scope="module")
def local(work):
    """What one machine comes to."""
    report = fabrig.batch(work / "work.toml", work / "local")
    assert report["is_complete"], report["failures"]
    return work / "local"


@pytest.fixture(scope="module")
def ray():
    ray = pytest.importorskip("ray")
    ray.init(num_cpus=2, include_dashboard=False, log_to_driver=False, logging_level="error")
    yield ray
    ray.shutdown()


def hashes(folder):
    files = (path for path in folder.rglob("*") if path.is_file())
    return {
        str(path.relative_to(folder)): hashlib.sha256(path.read_bytes()).hexdigest()
        for path in files
        if ".fabrig" not in path.relative_to(folder).parts
    }


def test_finished_work_is_not_done_again(work, local):
    before = hashes(local)
    assert len(before) == 1 + 2 + 4 + 4 + 1  # rig, topology, dataset, recordings, list
    said = []
    report = fabrig.batch(
        work / "work.toml", local, jobs=1, progress=lambda what, share: said.append(share)
    )
    assert report["counts"]["up_to_date"] == report["counts"]["jobs"] == 11
    assert report["engine"] == "local" and said[-1] == 0.0
    assert hashes(local) == before
    (local / "ann" / "early.mcap").write_bytes(b"")
    again = fabrig.batch(work / "work.toml", local, only=["*/early.mcap"])
    assert (again["counts"]["done"], again["counts"]["jobs"]) == (1, 3)
    assert hashes(local) == before


def test_arrays_come_back(work, local, tmp_path):
    report = fabrig.batch(work / "work.toml", only=["data/ann/late.npz", "ann/early.mcap"])
    results = report["results"]
    assert set(results) == {"data/ann/late.npz", "ann/early.mcap"}
    pair = results["data/ann/late.npz"]
    frames, vertices = pair["positions"].shape[:2]
    assert pair["weights"].shape == (frames, len(fabrig.ARKIT_SHAPES))
    assert pair["heads"].shape == (frames, 4, 4) and str(pair["unit"]) == "mm"
    assert np.allclose(np.diff(pair["times"]), 1 / float(pair["fps"]))
    # The same skin as a simulation by hand.
    clip = fabrig.read_motion(work / "take.csv")
    late = clip.between(0.3, clip.times[-1])
    assert frames == len(late)
    rig = fabrig.Rig.load(work / "ann.fabrig")
    simulation = fabrig.Simulation(rig, late)
    for _ in range(frames - 1):
        simulation.step(1 / 60)
    assert simulation.vertices.shape == (vertices, 3)
    in_head = simulation.vertices @ rig.to_head[:3, :3].T + rig.to_head[:3, 3]
    assert np.abs(in_head - pair["positions"][-1]).max() < 1e-3
    assert results["ann/early.mcap"] == (local / "ann" / "early.mcap").read_bytes()


def test_the_loader_reads_it(local):
    done = subprocess.run(
        [sys.executable, EXAMPLES / "load_dataset.py", local], capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.startswith("2 faces, 4 takes on them")
    listed = json.loads((local / "dataset.json").read_text())
    assert {pair["face"] for pair in listed["pairs"]} == {"ann", "bob"}


def test_what_is_wrong_is_named(work, tmp_path):
    bad = tmp_path / "bad.toml"
    bad.write_text('[[faces]]\nfiles = "x.obj"\n')
    with pytest.raises(fabrig.BatchError, match="bad.toml:2: 'files'.*nearest: 'file'"):
        fabrig.batch(bad, tmp_path)
    for arguments in ({"engine": "dask"}, {"jobs": 0}, {"address": "auto"}, {"retries": -1}):
        with pytest.raises(fabrig.InputError, match=next(iter(arguments))):
            fabrig.batch(work / "work.toml", tmp_path, **arguments)


def test_ray_comes_to_the_same_bytes(work, local, ray, tmp_path):
    out = tmp_path / "out"
    said = []
    report = fabrig.batch(
        work / "work.toml", out, engine="ray", progress=lambda _, share: said.append(share)
    )
    assert report["is_complete"], report["failures"]
    assert report["engine"] == "ray" and report["workers"] == 2 and said[-1] == 1
    assert hashes(out) == hashes(local)
    # Either engine goes on where the other was.
    here = fabrig.batch(work / "work.toml", out)
    assert here["counts"]["up_to_date"] == 11
    there = fabrig.batch(work / "work.toml", local, engine="ray")
    assert there["counts"]["up_to_date"] == 11


def test_ray_returns_arrays_without_a_shared_folder(work, local, ray):
    only = ["data/bob/early.npz", "data/bob/bob.face.npz"]
    report = fabrig.batch(work / "work.toml", engine="ray", only=only)
    assert report["is_complete"], report["failures"]
    assert set(report["results"]) == {*only, "rigs/bob.fabrig"}
    with np.load(local / only[0]) as expected:
        found = report["results"][only[0]]
        assert set(found) == set(expected.files)
        assert all(np.array_equal(found[name], expected[name]) for name in found)
    assert report["results"]["rigs/bob.fabrig"] == (local / "rigs/bob.fabrig").read_bytes()


def test_ray_names_what_is_broken(work, ray, tmp_path):
    (work / "eve.obj").write_text("nothing\n")
    text = (work / "work.toml").read_text() + '[[faces]]\nfile = "eve.obj"\n[[takes]]\nfile = "no.csv"\n'
    (work / "broken.toml").write_text(text)
    only = ["data/*/early.npz", "data/ann/no.npz"]
    reports = [
        fabrig.batch(work / "broken.toml", tmp_path / engine, engine=engine, only=only)
        for engine in ("local", "ray")
    ]
    for report in reports:
        assert not report["is_complete"]
        assert {row["subject"] for row in report["failures"]} == {"eve", "no"}
    assert reports[0]["failures"] == reports[1]["failures"]
    assert reports[0]["counts"] == reports[1]["counts"]
    # A folder that cannot be: everything is lost, and said so once.
    report = fabrig.batch(work / "work.toml", work / "work.toml" / "out", engine="ray")
    assert [row["kind"] for row in report["failures"]] == ["disk"]
    assert report["counts"]["lost"] == 11


def workers_of(process):
    """Processes below one that are at a job of a batch."""
    parents, busy = {}, set()
    for entry in pathlib.Path("/proc").iterdir():
        if not entry.name.isdigit():
            continue
        try:
            parents[int(entry.name)] = int((entry / "stat").read_text().rsplit(")", 1)[1].split()[1])
            if (entry / "cmdline").read_bytes().startswith(b"ray::_do"):
                busy.add(int(entry.name))
        except (OSError, ValueError):
            continue  # it ended meanwhile

    def is_below(pid):
        while pid and pid != process:
            pid = parents.get(pid, 0)
        return pid == process

    return {pid for pid in busy if is_below(pid)}


@pytest.mark.skipif(not pathlib.Path("/proc/self/cmdline").exists(), reason="needs Linux's /proc")
def test_a_killed_worker_costs_nothing(work, local, ray, tmp_path):
    out, killed = tmp_path / "out", []

    def kill():
        end = time.monotonic() + 120
        while time.monotonic() < end and not killed:
            for pid in workers_of(os.getpid()):
                os.kill(pid, signal.SIGKILL)
                killed.append(pid)
                return
            time.sleep(0.02)

    killer = threading.Thread(target=kill)
    killer.start()
    report = fabrig.batch(work / "work.toml", out, engine="ray")
    killer.join()
    assert killed, "no worker was seen at work"
    assert report["is_complete"], report["failures"]
    assert report["counts"]["done"] == 11
    assert hashes(out) == hashes(local)
    # What it left half written is gone with the next run at the latest.
    (out / "ann" / "late.mcap").unlink()
    assert fabrig.batch(work / "work.toml", out)["is_complete"]
    assert not [path for path in out.rglob("*") if path.name.endswith(".partial")]


def test_a_worker_that_always_dies_is_said(work, ray, tmp_path):
    """A limit on memory is what kills workers most; here they are told to die."""
    from fabrig import _batch

    def die(text, out, threads):
        os.kill(os.getpid(), signal.SIGKILL)

    honest, _batch._do = _batch._do, die
    try:
        report = fabrig.batch(
            work / "work.toml", tmp_path, engine="ray", retries=1, only=["ann/late.mcap"]
        )
    finally:
        _batch._do = honest
    assert [row["kind"] for row in report["failures"]] == ["worker"]
    assert report["failures"][0]["outputs"] == ["ann/late.mcap"]
    assert report["counts"]["failed"] == 1 and not report["is_complete"]
