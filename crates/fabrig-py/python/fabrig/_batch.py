"""Batches: many faces times many takes, here or on a Ray cluster."""

from __future__ import annotations

import heapq
import io
import json
import os
import tempfile
import time
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path as FilePath
from typing import Any, Union

import numpy as np

from ._fabrig import InputError, _batch_job, _BatchPlan
from ._interop import _needed
from ._types import Path, Progress


def batch(
    manifest: Path,
    out: Path | None = None,
    *,
    engine: str = "local",
    address: str | None = None,
    jobs: int | None = None,
    threads: int = 1,
    only: Sequence[str] = (),
    verify: bool = False,
    retries: int = 3,
    progress: Progress = None,
) -> dict[str, Any]:
    """Makes what a manifest asks for of many faces and takes; returns the report.

    Only what is missing or changed is made. What goes wrong with a face, a take or an output is in
    `failures` of the report, and `is_complete` is false; nothing else is lost by it.

    - `manifest`: a .toml or .csv file, as docs/batch.md has it
    - `out`: folder for everything that is made; without it, results come back in the report, as
      `results`: output -> arrays by name for .npz, bytes for other files, a dictionary for folders
    - `engine`: "local", or "ray" for a Ray cluster (`pip install 'fabrig[ray]'`), each worker of
      which has fabrig and sees the manifest's files and `out` under the same paths
    - `address`: of the cluster, as `ray.init` takes it; a cluster on this machine without it
    - `jobs`: jobs at a time; as many as there are processors without it
    - `threads`: of each job; results do not depend on it
    - `only`: names of outputs to make, with wildcards, and what they need
    - `verify`: read all results that are there, instead of trusting their size
    - `retries`: how often Ray begins a job again whose worker was lost
    - `progress`: called with ("batch", share), or True for a bar

    >>> fabrig.demo_face().write_obj("ann.obj")
    >>> fabrig.demo_take().between(0, 0.2).save("hello.csv")
    >>> text = '[[faces]]\\nfile = "ann.obj"\\n[[takes]]\\nfile = "hello.csv"\\n'
    >>> text += '[[outputs]]\\npath = "{face}/{take}.npz"\\ncontent = "dataset"\\n'
    >>> _ = open("work.toml", "w").write(text)
    >>> fabrig.batch("work.toml", "made")["counts"]["done"]
    3
    >>> fabrig.batch("work.toml", "made")["counts"]["up_to_date"]
    3
    """
    if engine not in ("local", "ray"):
        raise InputError(f"engine: '{engine}' is not one of local, ray")
    if engine == "local" and address is not None:
        raise InputError('address: only Ray has one; give engine="ray"')
    for name, value in (("jobs", 1 if jobs is None else jobs), ("threads", threads)):
        if value < 1:
            raise InputError(f"{name}: expected at least 1, got {value}")
    if retries < 0:
        raise InputError(f"retries: expected at least 0, got {retries}")
    with tempfile.TemporaryDirectory(prefix="fabrig-") as own:
        folder = FilePath(own) if out is None else FilePath(out)
        plan = _BatchPlan(os.fspath(manifest), os.fspath(folder), list(only), verify)
        if engine == "ray":
            return _on_ray(plan, folder, out is None, address, jobs, threads, retries, progress)
        report: dict[str, Any] = plan.run(jobs or 0, threads, progress)
        if out is None:
            made = [job["output"] for job in plan.jobs()]
            paths = [(output, folder / output) for output in made]
            report["results"] = {o: _loaded(_packed(p), o) for o, p in paths if p.exists()}
        return report


# A file as it is, or the files of a folder by their names; spelled for Python 3.10 at run time.
_Packed = Union[bytes, dict[str, bytes]]


def _packed(path: FilePath) -> _Packed:
    if path.is_dir():
        return {file.name: file.read_bytes() for file in sorted(path.iterdir())}
    return path.read_bytes()


def _unpack(packed: _Packed, path: FilePath) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    if isinstance(packed, bytes):
        path.write_bytes(packed)
        return
    path.mkdir()
    for name, content in packed.items():
        (path / name).write_bytes(content)


def _loaded(packed: _Packed, output: str) -> Any:
    if isinstance(packed, bytes) and output.lower().endswith(".npz"):
        with np.load(io.BytesIO(packed)) as archive:
            return {name: archive[name] for name in archive.files}
    return packed


def _do(text: str, out: str, threads: int) -> dict[str, Any]:
    """A job on a worker that sees the output folder."""
    return _batch_job(text, out, threads, None)


def _do_apart(
    text: str, threads: int, needs: list[str], *packed: _Packed | None
) -> tuple[dict[str, Any], _Packed | None]:
    """A job on a worker that sees no output folder: what it needs and makes goes with it."""
    with tempfile.TemporaryDirectory(prefix="fabrig-") as own:
        for output, content in zip(needs, packed):
            if content is not None:
                _unpack(content, FilePath(own) / output)
        outcome = _batch_job(text, own, threads, None)
        made = FilePath(own) / outcome["output"]
        return outcome, _packed(made) if made.exists() else None


def _on_ray(
    plan: _BatchPlan,
    folder: FilePath,
    is_apart: bool,
    address: str | None,
    jobs: int | None,
    threads: int,
    retries: int,
    progress: Progress,
) -> dict[str, Any]:
    ray = _needed("ray", "ray")
    start = time.monotonic()
    is_own = not ray.is_initialized()
    if is_own:
        here = {} if address else {"num_cpus": jobs, "include_dashboard": False}
        ray.init(address=address, log_to_driver=False, logging_level="error", **here)
    try:
        slots = max(1, int(ray.cluster_resources().get("CPU", 1)) // threads)
        if jobs is not None:
            slots = min(slots, jobs)
        failure = None if is_apart else plan.hold()
        board = _Board(plan.jobs())
        if failure is not None:
            board.lose_all(failure)
        options = {"num_cpus": threads, "max_retries": retries}
        if is_apart:
            board.run(ray, slots, _apart(ray, options, threads), _reporter(progress))
        else:
            out = os.fspath(folder.absolute())
            together = ray.remote(**options)(_do)

            def submit(job: dict[str, Any], made: dict[str, Any]) -> tuple[Any, Any]:
                return together.remote(job["text"], out, threads), None

            board.run(ray, slots, submit, _reporter(progress))
        outcomes = [json.dumps(outcome) for outcome in board.outcomes.values()]
        report: dict[str, Any] = plan.report(
            outcomes, "ray", slots, threads, time.monotonic() - start
        )
        if is_apart:
            made = ((output, ray.get(ref)) for output, ref in board.made.items())
            report["results"] = {o: _loaded(p, o) for o, p in made if p is not None}
        return report
    finally:
        plan.release()
        if is_own:
            ray.shutdown()


_Submit = Callable[[dict[str, Any], dict[str, Any]], tuple[Any, Any]]


def _apart(ray: Any, options: dict[str, Any], threads: int) -> _Submit:
    remote = ray.remote(num_returns=2, **options)(_do_apart)

    def submit(job: dict[str, Any], made: dict[str, Any]) -> tuple[Any, Any]:
        needs = job["needs"]
        ended, packed = remote.remote(job["text"], threads, needs, *(made.get(n) for n in needs))
        return ended, packed

    return submit


def _reporter(progress: Progress) -> Callable[[float], None]:
    if progress is True:
        from ._progress import Bar

        bar = Bar()
        return lambda share: bar.close() if share >= 1 else bar("batch", share)
    if not callable(progress):
        return lambda share: None
    called = progress

    def report(share: float) -> None:
        called("batch", share)

    return report


class _Board:
    """Which jobs can begin, and how they ended; Ray does the rest."""

    def __init__(self, jobs: list[dict[str, Any]]) -> None:
        self.jobs = jobs
        self.outcomes: dict[str, dict[str, Any]] = {}
        self.made: dict[str, Any] = {}
        self._dependents: dict[str, list[int]] = {}
        self._waiting = [0] * len(jobs)
        # Indices, the lowest first: pairs of one face follow each other.
        self._ready: list[int] = []
        to_run = {job["output"] for job in jobs if job["is_to_run"]}
        self.total = len(to_run)
        for index, job in enumerate(jobs):
            if not job["is_to_run"]:
                self.outcomes[job["output"]] = job["outcome"]
                continue
            needs = [need for need in job["needs"] if need in to_run]
            self._waiting[index] = len(needs)
            for need in needs:
                self._dependents.setdefault(need, []).append(index)
            if not needs:
                heapq.heappush(self._ready, index)

    def run(self, ray: Any, slots: int, submit: _Submit, report: Callable[[float], None]) -> None:
        running: dict[Any, int] = {}
        ended = 0
        try:
            while self._ready or running:
                while self._ready and len(running) < slots:
                    index = heapq.heappop(self._ready)
                    job = self.jobs[index]
                    if job["output"] in self.outcomes:
                        continue
                    ref, made = submit(job, self.made)
                    running[ref] = index
                    if made is not None:
                        self.made[job["output"]] = made
                if not running:
                    break
                done, _ = ray.wait(list(running), num_returns=1, timeout=0.2)
                for ref in done:
                    self._end(running.pop(ref), _outcome_of(ray, ref), running)
                    ended += 1
                report(ended / max(self.total, 1))
            report(1.0)
        except BaseException:
            for ref in running:
                ray.cancel(ref, force=True)
            raise

    def _end(self, index: int, outcome: dict[str, Any] | str, running: dict[Any, int]) -> None:
        job = self.jobs[index]
        if isinstance(outcome, str):
            failure = {"kind": "worker", "subject": job["output"], "message": outcome}
            outcome = _ended(job, "failed", failure)
        self.outcomes[job["output"]] = outcome
        ending = outcome["ending"]
        if "done" in ending:
            for dependent in self._dependents.get(job["output"], []):
                self._waiting[dependent] -= 1
                if self._waiting[dependent] == 0:
                    heapq.heappush(self._ready, dependent)
            return
        self.made.pop(job["output"], None)
        if "failed" not in ending:
            return
        cause: dict[str, Any] = ending["failed"]
        if cause["kind"] == "disk":
            self.lose_all(cause, set(running.values()))
        self._lose(job["output"], cause)

    def _lose(self, output: str, failure: dict[str, Any]) -> None:
        for index in self._dependents.get(output, []):
            job = self.jobs[index]
            self.outcomes.setdefault(job["output"], _ended(job, "lost", failure))
            self._lose(job["output"], failure)

    def lose_all(self, failure: dict[str, Any], begun: Iterable[int] = ()) -> None:
        """Nothing that is not begun will be."""
        self._ready.clear()
        kept = set(begun)
        for index, job in enumerate(self.jobs):
            if index not in kept and job["output"] not in self.outcomes:
                self.outcomes[job["output"]] = _ended(job, "lost", failure)


def _ended(job: dict[str, Any], how: str, failure: dict[str, Any]) -> dict[str, Any]:
    return {"output": job["output"], "ending": {how: failure}, "seconds": 0.0}


def _outcome_of(ray: Any, ref: Any) -> dict[str, Any] | str:
    try:
        outcome: dict[str, Any] = ray.get(ref)
        return outcome
    except ray.exceptions.RayError as error:
        # A worker that died as often as it may, or an object that is lost.
        lines = str(error).strip().splitlines() or [type(error).__name__]
        return f"the worker was lost: {lines[0]}"
