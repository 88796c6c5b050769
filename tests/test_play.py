"""`fabrig play` as an independent client of Foxglove's WebSocket protocol sees it.

Needs `pip install websockets mcap protobuf numpy pytest` and a Rust toolchain.
"""

import base64
import json
import os
import pathlib
import signal
import struct
import subprocess
import time

import numpy as np
import pytest
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from mcap.reader import make_reader
from websockets.sync.client import connect

ROOT = pathlib.Path(__file__).resolve().parent.parent
TARGET = pathlib.Path(os.environ.get("CARGO_TARGET_DIR", ROOT / "target"))
PATIENCE = 60
"""Seconds after which something does not come any more."""


@pytest.fixture(scope="module")
def program():
    """The binary with `play` in it."""
    made = subprocess.run(
        ["cargo", "build", "--release", "-q", "-p", "fabrig-cli", "--all-features"], cwd=ROOT
    )
    assert made.returncode == 0
    return TARGET / "release/fabrig"


@pytest.fixture(scope="module")
def rig(program, tmp_path_factory):
    folder = tmp_path_factory.mktemp("play")
    made = [program, "demo", "--without-dynamics", "--record", "weights"]
    made += ["-o", folder / "demo.mcap", "--rig", folder / "face.fabrig"]
    assert subprocess.run(made, stdout=subprocess.DEVNULL).returncode == 0
    return folder / "face.fabrig"


class Player:
    """A player that runs, and a viewer of it."""

    def __init__(self, program, *arguments):
        self.process = subprocess.Popen(
            [program, "play", *map(str, arguments), "--port", "0", "--json"],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
        )
        line = self.process.stdout.readline()
        assert line, self.process.stderr.read()
        self.socket = connect(
            json.loads(line)["url"], subprotocols=["foxglove.sdk.v1"], max_size=None
        )
        assert self.socket.subprotocol == "foxglove.sdk.v1"
        self.channels = {}
        self.info = self.until(lambda op, got: op == "serverInfo" and got)
        while "/log" not in self.channels or "/tf" not in self.channels:
            got = self.until(lambda op, got: op == "advertise" and got)
            self.channels |= {channel["topic"]: channel for channel in got["channels"]}
        self.topics = {}

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.socket.close()
        if self.process.poll() is None:
            self.process.kill()
        self.process.wait()

    def send(self, op, **fields):
        self.socket.send(json.dumps({"op": op, **fields}))

    def subscribe(self, *topics):
        self.topics |= dict(enumerate(topics, start=len(self.topics) + 1))
        asked = [
            {"id": id, "channelId": self.channels[topic]["id"]}
            for id, topic in self.topics.items()
            if topic in topics
        ]
        self.send("subscribe", subscriptions=asked)

    def receive(self):
        """The next message: ("message", (topic, time [ns], data)), ("time", ns) or (op, JSON)."""
        got = self.socket.recv(timeout=PATIENCE)
        if isinstance(got, str):
            got = json.loads(got)
            return got["op"], got
        if got[0] == 1:
            subscription, log_time = struct.unpack_from("<IQ", got, 1)
            return "message", (self.topics[subscription], log_time, got[13:])
        return "time", struct.unpack_from("<Q", got, 1)[0]

    def until(self, wanted):
        """What `wanted` makes of the first message that it takes."""
        end = time.monotonic() + PATIENCE
        while time.monotonic() < end:
            found = wanted(*self.receive())
            if found:
                return found
        raise AssertionError("it did not come")

    def decode(self, topic, data):
        """A message by the schema that the server gave."""
        channel = self.channels[topic]
        assert (channel["encoding"], channel["schemaEncoding"]) == ("protobuf", "protobuf")
        files = descriptor_pb2.FileDescriptorSet.FromString(base64.b64decode(channel["schema"]))
        pool = descriptor_pool.DescriptorPool()
        for file in files.file:
            pool.Add(file)
        name = pool.FindMessageTypeByName(channel["schemaName"])
        return message_factory.GetMessageClass(name).FromString(data)

    def next(self, topic, accept=lambda decoded: True):
        """The first message on a topic that is accepted, decoded."""

        def wanted(op, got):
            if op == "message" and got[0] == topic:
                decoded = self.decode(topic, got[2])
                return decoded if accept(decoded) else None
            return None

        return self.until(wanted)

    def set(self, *parameters):
        """Sets parameters; what the server says that they are then."""
        self.send("setParameters", parameters=list(parameters), id="set")
        answer = self.until(
            lambda op, got: op == "parameterValues" and got.get("id") == "set" and got
        )
        return {p["name"]: p["value"] for p in answer["parameters"]}


def points(cloud):
    """Positions of a cloud in message units."""
    data = np.frombuffer(cloud.data, np.uint8).reshape(-1, cloud.point_stride)
    return data[:, :12].copy().view("<f4")


@pytest.fixture(scope="module")
def recording(tmp_path_factory):
    given = os.environ.get("FABRIG_RECORDING")
    if given:
        return pathlib.Path(given)
    path = tmp_path_factory.mktemp("play") / "synthetic.mcap"
    made = subprocess.run(
        ["cargo", "run", "--release", "-q", "-p", "fabrig-core", "--example", "record_synthetic",
         "--", path, "1", "24"], cwd=ROOT,
    )  # fmt: skip
    assert made.returncode == 0
    return path


def test_a_recording_arrives_as_it_is(program, recording):
    stored = {}
    with open(recording, "rb") as file:
        for _, channel, message in make_reader(file).iter_messages():
            stored[channel.topic, message.log_time] = message.data
    topics = ["/tf", "/weights", "/rig/skin", "/points/skin"]
    # Slowly enough that no viewer is overrun.
    with Player(program, recording, "--once", "--mesh-hz", "60", "--speed", "0.5") as player:
        assert {"time", "parameters"} <= set(player.info["capabilities"])
        assert set(player.channels) == {topic for topic, _ in stored}
        player.subscribe(*topics)
        got, times = {}, []
        last = max(time for topic, time in stored if topic in topics)
        while ("/tf", last) not in got:
            op, content = player.receive()
            if op == "message":
                topic, log_time, data = content
                assert stored[topic, log_time] == data
                got[topic, log_time] = data
            elif op == "time":
                times.append(content)
        assert times == sorted(times)
        for topic in topics:
            wanted = sum(name == topic for name, _ in stored)
            # The viewer may have come to a topic a moment after another.
            assert sum(name == topic for name, _ in got) >= 0.9 * wanted, topic
        assert player.process.wait(PATIENCE) == 0


def test_pausing_holds_a_recording_and_meshes_are_thinned(program, recording):
    with Player(program, recording, "--speed", "0", "--mesh-hz", "10") as player:
        player.subscribe("/rig/skin", "/tf")
        assert player.set({"name": "speed", "value": 0.5}) == {"speed": 0.5}
        times = {"/rig/skin": [], "/tf": []}
        while len(times["/tf"]) < 50:
            op, content = player.receive()
            if op == "message":
                times[content[0]].append(content[1])
        gaps = np.diff(times["/rig/skin"])
        assert len(gaps) > 2 and gaps.min() >= 0.099e9
        assert np.diff(times["/tf"]).max() < 0.02e9
        # Nothing but what was on its way comes while it is paused.
        assert player.set({"name": "speed", "value": 0}) == {"speed": 0}
        with pytest.raises(TimeoutError):
            for _ in range(1000):
                player.socket.recv(timeout=2)


def test_a_viewer_moves_the_face(program, rig):
    with Player(program, rig, "--mesh-hz", "5") as player:
        player.subscribe("/weights", "/points/skin")
        rest = points(player.next("/points/skin"))
        assert player.next("/weights").jawOpen == 0
        player.send("getParameters", parameterNames=[], id="all")
        known = player.until(
            lambda op, got: op == "parameterValues" and got.get("id") == "all" and got
        )
        names = [p["name"] for p in known["parameters"]]
        assert names[0] == "speed" and sum(n.startswith("weights.") for n in names) == 52
        answer = player.set(
            {"name": "weights.jawOpen", "value": 0.75},
            {"name": "weights.eyeBlinkLeft", "value": 7},
            {"name": "weights.noSuchShape", "value": 1},
            {"name": "weights.mouthPucker", "value": "wide"},
        )
        # Out of range is brought into it; what cannot be set says what it is.
        assert answer == {
            "weights.jawOpen": 0.75, "weights.eyeBlinkLeft": 1, "weights.mouthPucker": 0,
        }  # fmt: skip
        set_ = player.next("/weights", lambda weights: weights.jawOpen > 0)
        assert (set_.jawOpen, set_.eyeBlinkLeft, set_.mouthPucker) == (0.75, 1, 0)
        # Message units are decimetres: a jaw opens by centimetres.
        far = lambda cloud: np.abs(points(cloud) - rest).max() > 0.2
        player.next("/points/skin", far)
        player.process.send_signal(signal.SIGINT)
        assert player.process.wait(PATIENCE) == 0


def test_a_take_plays_over_and_over_until_a_viewer_holds_it(program, rig, tmp_path):
    take = tmp_path / "take.keys"
    take.write_text("fabrig-keys 1\nfps 30\n0 jawOpen=0\n0.2 jawOpen=0.5\n0.4 jawOpen=0\n")
    with Player(program, rig, "--motion", take, "--record", "weights,points") as player:
        assert set(player.channels) == {
            "/tf", "/points/skin", "/points/patches", "/weights", "/stats", "/log",
        }  # fmt: skip
        player.subscribe("/weights")
        for _ in range(2):
            player.next("/weights", lambda weights: weights.jawOpen > 0.45)
            player.next("/weights", lambda weights: weights.jawOpen < 0.05)
        player.next("/weights", lambda weights: weights.jawOpen > 0.3)
        player.set({"name": "follow_take", "value": False})
        held = [player.next("/weights").jawOpen for _ in range(40)][-20:]
        assert min(held) == max(held)
        player.set({"name": "follow_take", "value": True})
        player.next("/weights", lambda weights: abs(weights.jawOpen - held[0]) > 0.1)


@pytest.mark.parametrize(
    "arguments, says",
    [
        (["missing.mcap"], "missing.mcap"),
        (["missing.fabrig"], "missing.fabrig"),
        (["x.mcap", "--motion", "take.csv"], "--motion"),
        (["x.mcap", "--speed=-1"], "speed"),
    ],
)
def test_bad_input_is_one_line(program, arguments, says):
    done = subprocess.run([program, "play", *arguments], capture_output=True, text=True)
    assert done.returncode in (1, 2) and len(done.stderr.splitlines()) == 1
    assert says in done.stderr
