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
POINTS = ["/points/skin", "/points/patches"]
SURFACE = ".entities[].triangles[]"
MESH = {
    "Mesh3D:vertex_positions": f"{SURFACE}.points[] | pack(.x!, .y!, .z!)",
    "Mesh3D:triangle_indices": f"{SURFACE}.mesh_triangles[] | pack(.a!, .b!, .c!)",
    "Mesh3D:vertex_normals": f"{SURFACE}.mesh_normals[] | pack(.x!, .y!, .z!)",
    "Mesh3D:vertex_colors": f"{SURFACE}.mesh_colors[]",
}
PLOTTED = 12
"""Lines in one plot, taken from all over the list; more cannot be told apart."""


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
        overrides={topic: mesh_overrides(topic) for topic in topics if topic.startswith("/rig")},
        spatial_information=rrb.SpatialInformation(target_frame=WORLD, show_axes=False),
        background=[34, 38, 43],
        line_grid=rrb.LineGrid3D(visible=False),
        eye_controls=rrb.EyeControls3D(
            position=[0, -3.6, 0.1], look_target=[0, 0, 0], eye_up=[0, 0, 1]
        ),
    )


def plot(name, topic, component, fields):
    """A plot of the first fields of a series message."""
    lines = [
        rr.SeriesLines(names=field).visualizer(
            mappings=[mapping("Scalars:scalars", component, f".{field}")]
        )
        for field in fields[:: -(-len(fields) // PLOTTED)]
    ]
    return rrb.TimeSeriesView(origin=topic, name=name, overrides={topic: lines})


def series_fields(path):
    """Field names of the weights and statistics, as the recorder listed them."""
    with open(path, "rb") as file:
        channels = make_reader(file).get_summary().channels.values()
        listed = {c.topic: c.metadata.get("fields", "") for c in channels}
    names = {topic: [n for n in text.split(",") if n] for topic, text in listed.items()}
    return names.get("/weights", []), names.get("/stats", [])


def blueprint(path):
    """The whole arrangement for one recording."""
    weights, stats = series_fields(path)
    below = []
    if weights:
        below.append(plot("Weights", "/weights", "fabrig.Weights:message", weights))
    if stats:
        # Energies are larger than everything else by orders of magnitude.
        energies = [name for name in stats if name.endswith("_energy")]
        others = [name for name in stats if name not in energies]
        for name, fields in [("Statistics", others), ("Energies", energies)]:
            if fields:
                below.append(plot(name, "/stats", "fabrig.Stats:message", fields))
    below.append(rrb.TextLogView(origin="/log", name="Log"))
    above = rrb.Horizontal(
        scene("Skin", [SKIN, PARTS]),
        scene("Muscles and fat", [PATCHES, PARTS]),
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
