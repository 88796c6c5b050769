#!/usr/bin/env python3
"""Open a fabrig recording in Rerun with shaded meshes and plots.

    python open_in_rerun.py TAKE.mcap                 open it in the viewer
    python open_in_rerun.py TAKE.mcap --save X.rbl    write the blueprint to a file instead

Needs `pip install rerun-sdk mcap`. Opened without this script, a recording shows points.

A blueprint is bound to the stem of the recording's file name, so a renamed recording needs a
new one. To apply a saved one, open the recording first and then run `rerun X.rbl`: giving
both files to one command does not apply it.
"""

import argparse
import pathlib
import subprocess
import sys
import time

import rerun as rr
import rerun.blueprint as rrb
from mcap.reader import make_reader
from rerun.blueprint.encodings import VisualizerComponentMapping

WORLD = "world"
HEAD = "head"
SKIN, PARTS, PATCHES = "/rig/skin", "/rig/parts", "/rig/patches"
STRAIN = "/rig/strain"
COLLIDERS = "/colliders"
POINTS = ["/points/skin", "/points/patches"]
SURFACE = ".entities[].triangles[]"
MESH = {
    "Mesh3D:vertex_positions": f"{SURFACE}.points[] | pack(.x!, .y!, .z!)",
    "Mesh3D:triangle_indices": f"{SURFACE}.mesh_triangles[] | pack(.a!, .b!, .c!)",
    "Mesh3D:vertex_normals": f"{SURFACE}.mesh_normals[] | pack(.x!, .y!, .z!)",
    "Mesh3D:vertex_colors": f"{SURFACE}.mesh_colors[]",
}
UNITS = {
    "_mm": "Distances (mm)",
    "_newton": "Forces (N)",
    "_energy": "Energies",
    "_ms": "Times (ms)",
    "": "Counts",
}
"""What a plot of statistics is called, by the end of their names."""


def mapping(target, component, selector):
    """Feeds a slot of a visualizer from a field of a recorded message."""
    return VisualizerComponentMapping(
        target, "SourceComponent", source_component=component, selector=selector
    )


def mesh_overrides(topic):
    """Draws a scene topic as a mesh that stands in the head's frame."""
    component = "foxglove.SceneUpdate:message"
    maps = [mapping(target, component, selector) for target, selector in MESH.items()]
    return [rr.Mesh3D.from_fields().visualizer(mappings=maps), rr.CoordinateFrame(HEAD)]


def scene(name, topics):
    """A view of some topics from the front, +Z up."""
    return rrb.Spatial3DView(
        origin="/",
        name=name,
        contents=[*topics, "/tf"],
        overrides={topic: mesh_overrides(topic) for topic in topics},
        spatial_information=rrb.SpatialInformation(target_frame=WORLD, show_axes=False),
        background=[34, 38, 43],
        line_grid=rrb.LineGrid3D(visible=False),
        eye_controls=rrb.EyeControls3D(
            position=[0, -3.6, 0.1], look_target=[0, 0, 0], eye_up=[0, 0, 1]
        ),
    )


def plot(name, topic, component, fields):
    """A plot of some fields of a series message."""
    lines = [
        rr.SeriesLines(names=field).visualizer(
            mappings=[mapping("Scalars:scalars", component, f".{field}")]
        )
        for field in fields
    ]
    return rrb.TimeSeriesView(origin=topic, name=name, overrides={topic: lines})


def read_summary(path):
    """Topics with messages, and what the weights' and statistics' channels say of their fields."""
    with open(path, "rb") as file:
        summary = make_reader(file).get_summary()
    channels = {c.topic: c for c in summary.channels.values()}
    counts = summary.statistics.channel_message_counts
    topics = {topic for topic, channel in channels.items() if counts.get(channel.id)}

    def listed(topic, key):
        channel = channels.get(topic)
        text = channel.metadata.get(key, "") if channel else ""
        return [name for name in text.split(",") if name]

    return topics, listed("/weights", "plotted"), listed("/stats", "fields")


def unit(name):
    """The end of a statistic's name that tells its unit."""
    return next(end for end in UNITS if name.endswith(end))


def blueprint(path):
    """The whole arrangement for one recording."""
    topics, weights, stats = read_summary(path)
    below = []
    if weights:
        below.append(plot("Weights", "/weights", "fabrig.Weights:message", weights))
    for end, title in UNITS.items():
        fields = [name for name in stats if unit(name) == end]
        if fields:
            below.append(plot(title, "/stats", "fabrig.Stats:message", fields))
    below.append(rrb.TextLogView(origin="/log", name="Log"))
    colliders = [COLLIDERS] if COLLIDERS in topics else []
    above = rrb.Horizontal(
        scene("Skin", [SKIN, PARTS, *colliders]),
        scene("Muscles and fat", [PATCHES, PARTS, *colliders]),
        *([scene("Strain", [STRAIN, PARTS])] if STRAIN in topics else []),
        rrb.Spatial3DView(
            origin="/",
            name="Points",
            contents=[*POINTS, "/tf"],
            spatial_information=rrb.SpatialInformation(target_frame=WORLD),
            visible=False,
        ),
    )
    return rrb.Blueprint(
        rrb.Vertical(above, rrb.Horizontal(*below), row_shares=[2, 1]),
        rrb.TimePanel(timeline="message_log_time", state="collapsed"),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
        auto_views=False,
    )


def main():
    """Command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("recording", type=pathlib.Path)
    parser.add_argument("--save", type=pathlib.Path, help="write the blueprint to this file")
    parser.add_argument("--port", type=int, default=9876)
    args = parser.parse_args()
    if not args.recording.is_file():
        sys.exit(f"no such file: {args.recording}")
    stem = args.recording.stem
    made = blueprint(args.recording)
    if args.save:
        made.save(stem, args.save)
        return
    viewer = subprocess.Popen(["rerun", str(args.recording), "--port", str(args.port)])
    time.sleep(3)  # The viewer must know the recording before it takes its blueprint.
    rr.init(stem)
    rr.connect_grpc(f"rerun+http://127.0.0.1:{args.port}/proxy")
    rr.send_blueprint(made)
    sys.exit(viewer.wait())


if __name__ == "__main__":
    main()
