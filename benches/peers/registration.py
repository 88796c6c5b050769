"""The same faces and landmarks through trimesh's non-rigid ICP (Amberg 2007) and through fabrig.

The truth is known: each face is the template itself, smoothly warped, and then given another
topology, so that the true place of every template vertex is known while neither side can see it.
What is compared is the distance of each vertex of the face from its true place, at true head
size. trimesh's is timed for the deformation alone, from a start that the landmarks align;
fabrig's for its whole registration, cleaning and alignment and report included; how long the
same job alone took it (deformation), and everything from arrays to a rig, is in the JSON.
"""

import argparse
import json
import pathlib
import time

import numpy as np
import trimesh
from trimesh.registration import nricp_amberg, procrustes

import fabrig

LANDMARKS = [
    "eye_inner_l",
    "eye_inner_r",
    "eye_outer_l",
    "eye_outer_r",
    "lip_corner_l",
    "lip_corner_r",
    "nose_tip",
    "pogonion",
]
NOT_FACE = ("mouth_interior", "socket", "nostril", "neck", "scalp", "ear")
REGISTRATION_STAGES = ("clean", "align", "deform", "refine", "map", "report")


def warp(points, strength):
    """A smooth, asymmetric change of proportions: at strength 1 some mm, several on the nose."""
    x, y, z = points.T
    scaled = np.stack([x * (1.05 + 4e-4 * y), y * 0.96, z * 1.03 + 3e-4 * y**2], 1)
    bumps = [
        ((0, -10, 40), 25, (0.5, -2, 4)),
        ((0, -80, 20), 40, (2, -4, 3)),
        ((45, 0, 10), 35, (3, 1, -1)),
    ]
    moved = scaled - points
    for center, radius, by in bumps:
        near = np.exp(-np.sum((points - center) ** 2, 1) / radius**2)
        moved += near[:, None] * np.array(by)
    return points + strength * moved


def remeshed(points, triangles):
    """Vertices at the edges' middles alone: no vertex of the original is left."""
    sides = np.sort(triangles[:, [0, 1, 1, 2, 2, 0]].reshape(-1, 2), axis=1)
    edges, number = np.unique(sides, axis=0, return_inverse=True)
    middle = number.reshape(-1, 3)
    faces = [list(map(int, face)) for face in middle]
    around = [{} for _ in points]
    for corners, (ab, bc, ca) in zip(triangles, middle):
        for corner, start, end in zip(corners, (ab, bc, ca), (ca, ab, bc)):
            around[corner][int(start)] = int(end)
    for ring in around:
        polygon = [next(iter(ring))] if ring else []
        while polygon and len(polygon) <= len(ring):
            following = ring.get(polygon[-1])
            if following == polygon[0] and len(polygon) == len(ring):
                faces.append(polygon)
            if following is None or following == polygon[0]:
                break
            polygon.append(following)
    return points[edges].mean(axis=1), faces


def cases(folder):
    """Name, vertices, faces and true places of the template's vertices of each face."""
    template = fabrig.template().mesh
    for strength in (0.5, 1.0):
        truth = warp(template.vertices, strength)
        vertices, faces = remeshed(truth, template.triangles)
        yield f"template warped by {strength}, remeshed", vertices, faces, truth
    for path in sorted(pathlib.Path(folder).glob("*.truth.obj")) if folder else ():
        mesh = fabrig.read_mesh(path.with_name(path.name.replace(".truth", "")))
        name = path.name.removesuffix(".truth.obj").replace("_", " ")
        yield name, mesh.vertices, mesh.faces, fabrig.read_mesh(path).vertices


def figures(errors):
    """Median, 95 % and largest."""
    return {
        "median_mm": float(np.median(errors)),
        "p95_mm": float(np.percentile(errors, 95)),
        "max_mm": float(errors.max()),
    }


def by_fabrig(vertices, faces, landmarks, truth, is_face):
    """A rig, and how far its normalized face is from the truth."""
    wall, cpu = time.perf_counter(), time.process_time()
    rig = fabrig.rig(vertices, faces, landmarks=landmarks)
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    to_head = rig.to_head
    placed = truth @ to_head[:3, :3].T + to_head[:3, 3]
    errors = np.linalg.norm(rig.normalized - placed, axis=1)[is_face]
    stages = {stage["stage"]: stage["seconds"] for stage in rig.report["times"]}
    registration = sum(stages.get(name, 0.0) for name in REGISTRATION_STAGES)
    deformation = stages["deform"] + stages["refine"]
    # Stages have the wall's time alone: the processors' is shared out in proportion.
    result = {
        "to_rig_seconds": wall,
        "registration_seconds": registration,
        "deformation_seconds": deformation,
        "to_rig_cpu_seconds": cpu,
        "cpu_seconds": cpu * registration / wall,
        "deformation_cpu_seconds": cpu * deformation / wall,
    }
    return result | figures(errors), rig.millimetres_per_unit


def by_trimesh(vertices, faces, landmarks, truth, is_face, millimetres):
    """trimesh's own defaults from a start that the landmarks align, with vertex normals."""
    template = fabrig.template()
    numbers = np.array([template.landmarks[name] for name in landmarks])
    places = np.array(list(landmarks.values()))
    start = template.mesh.vertices
    pose = procrustes(start[numbers], places, reflection=False)[0]
    aligned = trimesh.transform_points(start, pose)
    source = trimesh.Trimesh(aligned, template.mesh.triangles, process=False)
    mesh = fabrig.Mesh(vertices, faces)
    target = trimesh.Trimesh(mesh.vertices, mesh.triangles, process=False)
    wall, cpu = time.perf_counter(), time.process_time()
    found = nricp_amberg(source, target, source_landmarks=numbers, target_positions=places)
    wall, cpu = time.perf_counter() - wall, time.process_time() - cpu
    errors = millimetres * np.linalg.norm(found - truth, axis=1)[is_face]
    return {"registration_seconds": wall, "cpu_seconds": cpu} | figures(errors)


def run(folder=None, count=None):
    """Every case through both."""
    template = fabrig.template()
    is_face = np.array([not name.startswith(NOT_FACE) for name in template.regions])
    results = []
    for name, vertices, faces, truth in list(cases(folder))[:count]:
        landmarks = {name: truth[template.landmarks[name]] for name in LANDMARKS}
        ours, millimetres = by_fabrig(vertices, faces, landmarks, truth, is_face)
        try:
            peer = by_trimesh(vertices, faces, landmarks, truth, is_face, millimetres)
        except Exception as error:  # noqa: BLE001 - a peer that fails is a result.
            peer = {"failed": f"{type(error).__name__}: {error}"}
        results.append({"case": name, "vertices": len(vertices), "fabrig": ours, "trimesh": peer})
    return results


def table(results):
    """The results as Markdown."""
    lines = [
        "| face | vertices | engine | s | processor s | of it deformation | median | 95 % | max [mm] |",
        "|---|---|---|---|---|---|---|---|---|",
    ]
    for row in results:
        for engine in ("fabrig", "trimesh"):
            r = row[engine]
            start = f"| {row['case']} | {row['vertices']} | {engine} | "
            if "failed" in r:
                lines.append(start + f"{r['failed']} | | | | | |")
                continue
            lines.append(
                start
                + f"{r['registration_seconds']:.2f} | {r['cpu_seconds']:.2f} | "
                + f"{r.get('deformation_cpu_seconds', r['cpu_seconds']):.2f} | "
                + f"{r['median_mm']:.2f} | {r['p95_mm']:.2f} | {r['max_mm']:.2f} |"
            )
    return "\n".join(lines)


def main():
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--cases", help="also the faces that `fabrig bench registration --write FOLDER` wrote"
    )
    parser.add_argument("--count", type=int, help="only the first so many faces")
    args = parser.parse_args()
    results = run(args.cases, args.count)
    print(table(results))
    print(json.dumps(results))


if __name__ == "__main__":
    main()
