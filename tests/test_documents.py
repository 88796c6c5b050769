"""Every command of every document runs: what stands in ```sh blocks of README.md, docs and the guide.

Each document has a folder of its own with the files that people bring: `face.obj`, `take.csv`,
`landmarks.json`, `work.toml`, the scenes of docs/scenes, and what earlier commands of other documents make: `face.fabrig`,
`out.mcap`. Commands are the documents', but for options that make them quick (smaller pictures,
shapes that need not settle); the few that are not run are listed with the reason.
"""

import json
import os
import pathlib
import re
import shutil
import signal
import subprocess
import sys

import numpy as np
import pytest

import fabrig

ROOT = pathlib.Path(__file__).resolve().parent.parent
TARGET = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
TOOLS = pathlib.Path(sys.executable).parent
DOCUMENTS = sorted(
    path.relative_to(ROOT)
    for path in [ROOT / "README.md", *ROOT.glob("docs/**/*.md")]
    if "```sh\n" in path.read_text()
)
ELSEWHERE = {
    "cargo install": "installs for the user; tests/run.sh builds the same",
    "pip install": "installs for the user; tests/run.sh does so in an environment of its own",
    "bash tests/run.sh": "is what runs this",
    "python crates/fabrig-core/viewers/open_in_rerun.py": "opens a window; test_rerun_picture.py",
    "fabrig bench batch": "eight faces; the crate's own tests make fewer",
}
QUICK = {
    "fabrig bench economy": ["--scenes", "1", "--frames", "30"],
    "fabrig export": ["--without-dynamics", "--skip-check"],
    "fabrig render": ["--size", "64"],
}
ONCE = ("fabrig check", "fabrig demo")
"""Slow, and the same wherever the same command stands: run for the first document that has it."""
TAKE = """Timecode,BlendShapeCount,JawOpen,MouthSmileLeft
00:00:00:00.000,61,0,0
00:00:00:30.000,61,0.6,0.3
00:00:01:00.000,61,0.1,0.8
"""
WORK = """[[faces]]
file = "face.obj"
name = "ann"
[[takes]]
file = "take.csv"
name = "hello"
[[outputs]]
path = "{face}/{take}.{format}"
formats = ["mcap"]
"""


@pytest.fixture(scope="module")
def brought(tmp_path_factory):
    """A folder with what the documents take for granted, and the environment to run them in."""
    made = subprocess.run(
        ["cargo", "build", "--release", "-q", "-p", "fabrig-cli", "--all-features"], cwd=ROOT
    )
    assert made.returncode == 0
    folder = tmp_path_factory.mktemp("brought")
    face = fabrig.demo_face()
    face.write_obj(folder / "face.obj")
    rig = fabrig.rig(face)
    rig.save(folder / "face.fabrig")
    (folder / "take.csv").write_text(TAKE)
    (folder / "work.toml").write_text(WORK)
    for scene in (ROOT / "docs/scenes").glob("*.toml"):
        shutil.copy(scene, folder)
    places = fabrig.template().landmarks
    to_own = [list(row) for row in np.linalg.inv(rig.to_head)]
    names = ("nose_tip", "menton", "eye_inner_l", "eye_inner_r", "lip_corner_l")
    own = {}
    for name in names:
        place = [*rig.normalized[places[name]], 1]
        own[name] = [sum(a * b for a, b in zip(row, place, strict=True)) for row in to_own[:3]]
    (folder / "landmarks.json").write_text(json.dumps(own))
    path = f"{TARGET / 'release'}{os.pathsep}{TOOLS}{os.pathsep}{os.environ['PATH']}"
    environment = dict(os.environ, PATH=path)
    made = ["fabrig", "animate", "face.fabrig", "--motion", "take.csv", "-o", "out.mcap"]
    assert subprocess.run(made, cwd=folder, env=environment, capture_output=True).returncode == 0
    return folder, environment


def commands(document):
    """The commands of a document: lines, and those that a heredoc belongs to with it."""
    found = []
    for block in re.findall(r"```sh\n(.*?)```", (ROOT / document).read_text(), re.S):
        lines = iter(block.splitlines())
        for line in lines:
            if end := re.search(r"<<'?(\w+)'?", line):
                for inner in lines:
                    line += "\n" + inner
                    if inner == end[1]:
                        break
            elif not (line := line.split(" #")[0].strip()):
                continue
            found.append(line)
    return found


def test_documents_have_commands():
    assert len(DOCUMENTS) > 8 and sum(len(commands(d)) for d in DOCUMENTS) > 40


ran = set()


@pytest.mark.parametrize("document", DOCUMENTS, ids=str)
def test_every_command_runs(document, brought, tmp_path):
    prepared, environment = brought
    folder = shutil.copytree(prepared, tmp_path / "work")
    for command in commands(document):
        if any(command.startswith(known) for known in ELSEWHERE):
            continue
        # What cargo runs is built already.
        command = command.replace("cargo run --release -p fabrig-cli --", "fabrig")
        if command.startswith(ONCE):
            if command in ran:
                continue
            ran.add(command)
        for verb, options in QUICK.items():
            if command.startswith(verb) and options[0] not in command:
                command = " ".join([command, *options])
        if command.startswith("fabrig play"):
            play(f"{command} --port 0", folder, environment)
            continue
        done = subprocess.run(
            ["bash", "-euo", "pipefail", "-c", command],
            cwd=folder, env=environment, capture_output=True, text=True,
        )  # fmt: skip
        # A gate that does not hold is a result too.
        good = (0, 3) if command.startswith("fabrig check") else (0,)
        assert done.returncode in good, f"{command}: {done.stderr}"
        output = re.search(r"(?:-o|--report|--layout) (\S+)", command)
        if output and "--dry-run" not in command:
            assert (folder / output[1]).exists(), command


def play(command, folder, environment):
    """Plays until the address is said, then ends it as a person does."""
    player = subprocess.Popen(
        command.split(), cwd=folder, env=environment, stdout=subprocess.PIPE, text=True
    )
    assert player.stdout.readline(), command
    player.send_signal(signal.SIGINT)
    assert player.wait(60) == 0, command
