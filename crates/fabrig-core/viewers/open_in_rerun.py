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
SKIN, PARTS, PATCHES = "/rig/skin", "/rig/parts", "/rig/patches"
STRAIN = "/rig/strain"
COLLIDERS = "/colliders"
POINTS = ["/points/skin", "/points/patches"]
KNOWN = [
    *(SKIN, PARTS, PATCHES, STRAIN, COLLIDERS, *POINTS),
    *("/contacts", "/points/magnets", "/weights", "/stats", "/tf", "/log"),
]
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


def face_of(topic):
    """The face that goes before a topic, as `/ann`; nothing where a recording has one face."""
    for known in KNOWN:
        if topic.endswith(known):
            return topic.removesuffix(known)
    return ""


def head_of(topic):
    """The frame that a topic's geometry stands in."""
    return f"{face_of(topic)}/head".strip("/")


def mesh_overrides(topic):
    """Draws a scene topic as a mesh that stands in the head's frame."""
    component = "foxglove.SceneUpdate:message"
    maps = [mapping(target, component, selector) for target, selector in MESH.items()]
    return [rr.Mesh3D.from_fields().visualizer(mappings=maps), rr.CoordinateFrame(head_of(topic))]


def transforms(topics):
    """The topics that place the faces of others."""
    return sorted({f"{face_of(topic)}/tf" for topic in topics})


def scene(name, topics):
    """A view of some topics from the front, +Z up."""
    return rrb.Spatial3DView(
        origin="/",
        name=name,
        contents=[*topics, *transforms(topics)],
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
    """Topics with messages, and a function for what a channel says of its fields."""
    with open(path, "rb") as file:
        summary = make_reader(file).get_summary()
    channels = {c.topic: c for c in summary.channels.values()}
    counts = summary.statistics.channel_message_counts
    topics = {topic for topic, channel in channels.items() if counts.get(channel.id)}

    def listed(topic, key):
        channel = channels.get(topic)
        text = channel.metadata.get(key, "") if channel else ""
        return [name for name in text.split(",") if name]

    return topics, listed


def unit(name):
    """The end of a statistic's name that tells its unit."""
    return next(end for end in UNITS if name.endswith(end))


def blueprint(path):
    """The whole arrangement for one recording."""
    topics, listed = read_summary(path)
    faces = sorted({face_of(topic) for topic in topics})
    below = []
    for face in faces:
        of_face = f" {face[1:]}" if face else ""
        if weights := listed(f"{face}/weights", "plotted"):
            component = "fabrig.Weights:message"
            below.append(plot(f"Weights{of_face}", f"{face}/weights", component, weights))
        stats = listed(f"{face}/stats", "fields")
        for end, title in UNITS.items():
            fields = [name for name in stats if unit(name) == end]
            if fields:
                component = "fabrig.Stats:message"
                below.append(plot(f"{title}{of_face}", f"{face}/stats", component, fields))
    below.append(rrb.TextLogView(origin=f"{faces[0]}/log", name="Log"))

    def of_all(*wanted):
        return [face + topic for face in faces for topic in wanted]

    colliders = [topic for topic in of_all(COLLIDERS) if topic in topics]
    strained = [topic for topic in of_all(STRAIN) if topic in topics]
    points = of_all(*POINTS)
    above = rrb.Horizontal(
        scene("Skin", [*of_all(SKIN, PARTS), *colliders]),
        scene("Muscles and fat", [*of_all(PATCHES, PARTS), *colliders]),
        *([scene("Strain", [*strained, *of_all(PARTS)])] if strained else []),
        rrb.Spatial3DView(
            origin="/",
            name="Points",
            contents=[*points, *transforms(points)],
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
