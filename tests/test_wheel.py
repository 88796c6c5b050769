"""The wheel is what it says: one for Python 3.10 and up, with nothing of Rust to run it.

FABRIG_WHEEL names the wheel; `tests/run.sh` sets it.
"""

import os
import pathlib
import shutil
import subprocess
import sys

import pytest

WHEEL = os.environ.get("FABRIG_WHEEL")
pytestmark = pytest.mark.skipif(WHEEL is None, reason="FABRIG_WHEEL is not set")
PATH = "/usr/bin:/bin"

PROGRAM = """
import fabrig
face = fabrig.demo_face()
rig = fabrig.rig(face)
simulation = fabrig.Simulation(rig)
simulation.step(1 / 60, weights={"jawOpen": 0.5})
rig.save("face.fabrig")
assert fabrig.Rig.load("face.fabrig").node_count == 19_380
report = fabrig.animate(rig, fabrig.demo_take().between(0, 0.1), "out.mcap")
print(fabrig.__file__, simulation.vertices.shape, report["frames"])
"""


def run(*command, **options):
    done = subprocess.run(
        [str(part) for part in command], capture_output=True, text=True, **options
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_it_is_for_every_python_from_3_10():
    assert "-cp310-abi3-" in pathlib.Path(WHEEL).name


def test_auditwheel_finds_only_what_every_linux_has():
    pytest.importorskip("auditwheel")
    said = " ".join(run(sys.executable, "-m", "auditwheel", "show", WHEEL).split())
    assert 'consistent with the following platform tag: "manylinux' in said, said


@pytest.mark.parametrize("version", ["", "3.10", "3.11", "3.12", "3.13", "3.14"])
def test_it_runs_in_a_clean_environment(version, tmp_path):
    interpreter = shutil.which(f"python{version}") if version else sys.executable
    if interpreter is None:
        pytest.skip(f"there is no Python {version} here")
    probe = [interpreter, "-c", "import sys; print(sys.version_info[:2])"]
    found = subprocess.run(probe, capture_output=True, text=True)
    here = str(sys.version_info[:2])
    if version and (found.returncode != 0 or found.stdout.strip() == here):
        pytest.skip(f"Python {version} does not start here, or is this one")
    assert shutil.which("cargo", path=PATH) is None and shutil.which("rustc", path=PATH) is None
    # What pip needs to reach its index, and nothing else.
    kept = ("PIP_", "SSL_", "HTTP", "REQUESTS_")
    environment = {name: value for name, value in os.environ.items() if name.startswith(kept)}
    environment |= {"PATH": PATH, "HOME": str(tmp_path)}
    run(interpreter, "-m", "venv", tmp_path / "venv")
    python = tmp_path / "venv/bin/python"
    run(python, "-m", "pip", "install", "-q", WHEEL, env=environment)
    said = run(python, "-c", PROGRAM, env=environment, cwd=tmp_path)
    assert str(tmp_path) in said and "(13082, 3)" in said
