"""Runs one engine on one scene and prints what was measured as one line of JSON.

Called by `run.py` in a process of its own, so that an engine that crashes takes nothing with it.
"""

import argparse
import importlib
import json
import sys

import numpy as np

import scenes

LOST = 1.0
"""A node this far from where it belongs has left the scene [m]."""


def run(engine, entry, scene, substeps, frames):
    """Steps through some frames; figures in ms and shares."""
    module = importlib.import_module(f"engines.{engine}")
    made = getattr(module, entry)(scene, substeps)
    is_patches = isinstance(scene, scenes.Patches)
    wall, cpu, strains, distances, lengths = [], [], [], [], []
    for frame in range(1, frames + 1):
        wanted = scene.targets(frame / scenes.FPS) if is_patches else scene.rest
        clock = made.step(wanted if is_patches else None)
        wall.append(clock.wall_ms)
        cpu.append(clock.cpu_ms)
        now = made.positions()
        away = np.linalg.norm(now - wanted.reshape(-1, 3), axis=1)
        if not np.isfinite(now).all() or away.max() > LOST:
            return {"state": "diverged", "frame": frame}
        if is_patches:
            strains.append(scene.strain(now))
            distances.append(float(np.sqrt(np.mean(away**2))))
        else:
            lengths.append(scene.measured(now))
    half = frames // 2
    result = {
        "state": "ran",
        "frames": frames,
        "wall_ms": float(np.median(wall[half // 2 :])),
        "cpu_ms": float(np.median(cpu[half // 2 :])),
    }
    if is_patches:
        result["strain_percent"] = 100 * float(np.sqrt(np.mean(np.square(strains))))
        result["from_target_mm"] = 1e3 * float(np.sqrt(np.mean(np.square(distances))))
    else:
        # A cloth that still swings has its mean where it will come to rest.
        mean = float(np.mean(lengths[half:]))
        result["elongation_error_percent"] = 100 * abs(mean / scene.elongation - 1)
    return result


def main():
    """Command line."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("engine")
    parser.add_argument("entry")
    parser.add_argument("substeps", type=int)
    parser.add_argument("frames", type=int)
    parser.add_argument("--patches", type=int, default=20)
    parser.add_argument("--side", type=int)
    args = parser.parse_args()
    if args.entry.startswith("patches"):
        scene = scenes.Patches(args.patches, args.side or 31)
    else:
        scene = scenes.Hanging(args.side or 40)
    result = run(args.engine, args.entry, scene, args.substeps, args.frames)
    sys.stdout.write("\nRESULT " + json.dumps(result) + "\n")


if __name__ == "__main__":
    main()
