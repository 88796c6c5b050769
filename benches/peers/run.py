"""fabrig beside its peers in one run: a table on standard output, all figures as JSON.

    python run.py                    everything; quiet machine, about an hour
    python run.py --smoke            fabrig's own side alone, tiny
    python run.py --only cloth       cloth or registration alone
"""

import argparse
import json
import os
import pathlib
import platform
import subprocess
import sys

FOLDER = pathlib.Path(__file__).resolve().parent
PATCHES = [
    ("fabrig", "fabrig_engine", "patches", [1, 2, 4, 8, 16]),
    ("fabrig (f64)", "fabrig_engine", "patches_double", [128]),
    ("pyPBD", "pypbd_engine", "patches", [8, 32]),
    ("Blender", "bpy_engine", "patches", [1, 5]),
    ("Newton (XPBD)", "newton_engine", "patches_xpbd", [8, 32]),
    ("Newton (semi-implicit)", "newton_engine", "patches", [8, 32, 100]),
    ("MuJoCo", "mujoco_engine", "patches", [1, 4]),
]
HANGING = [
    ("fabrig", "fabrig_engine", "hanging", [8, 32, 128]),
    ("pyPBD", "pypbd_engine", "hanging", [8, 32, 128]),
    ("Blender", "bpy_engine", "hanging", [1, 5]),
    ("Newton (XPBD)", "newton_engine", "hanging_xpbd", [32, 128]),
    ("Newton (semi-implicit)", "newton_engine", "hanging", [128]),
    ("MuJoCo", "mujoco_engine", "hanging", [8, 32]),
]


def measure(name, module, entry, substeps, frames, timeout, more=(), threads=None):
    """One engine in a process of its own; what fails says how."""
    command = [sys.executable, "cloth.py", module, entry, str(substeps), str(frames), *more]
    start = {"engine": name, "scene": entry.split("_")[0], "substeps": substeps}
    environment = dict(os.environ)
    if threads:
        environment |= {"OMP_NUM_THREADS": str(threads), "RAYON_NUM_THREADS": str(threads)}
    try:
        done = subprocess.run(
            command,
            cwd=FOLDER,
            capture_output=True,
            text=True,
            timeout=timeout,
            check=False,
            env=environment,
        )
    except subprocess.TimeoutExpired:
        return start | {"state": f"not done after {timeout} s"}
    for line in done.stdout.splitlines():
        if line.startswith("RESULT "):
            return start | json.loads(line.removeprefix("RESULT "))
    words = (done.stderr.strip() or f"exit code {done.returncode}").splitlines()[-1]
    return start | {"state": f"failed: {words}"}


def row(result):
    """One line of the table."""
    start = f"| {result['engine']} | {result['substeps']} | "
    if result["state"] != "ran":
        where = f" in frame {result['frame']}" if "frame" in result else ""
        return start + f"{result['state']}{where} | | | |"
    start += f"{result['wall_ms']:.2f} | {result['cpu_ms']:.2f} | "
    if result["scene"] == "hanging":
        return start + f"{result['elongation_error_percent']:.4f} | |"
    return start + f"{result['strain_percent']:.3f} | {result['from_target_mm']:.2f} |"


def cloth(args):
    """Both scenes through every engine."""
    results = []
    frames = {"patches": 60, "hanging": 240}
    more = ()
    plan = [("patches", PATCHES), ("hanging", HANGING)]
    if args.smoke:
        frames = {"patches": 4, "hanging": 4}
        plan = [("patches", [("fabrig", "fabrig_engine", "patches", [8])])]
        more = ("--patches", "1", "--side", "9")
    for scene, engines in plan:
        last = "strain [%] | from target [mm]" if scene == "patches" else "elongation error [%] |"
        print(f"\n{scene}\n\n| engine | substeps | ms/frame | processor ms | {last} |")
        print("|---|---|---|---|---|---|", flush=True)
        for name, module, entry, substeps in engines:
            for count in substeps:
                count_frames = args.frames or frames[scene]
                result = measure(
                    name, module, entry, count, count_frames, args.timeout, more, args.threads
                )
                results.append(result)
                print(row(result), flush=True)
    return results


def main():
    """Command line; fails only where fabrig's own side does."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("--only", choices=["cloth", "registration"])
    parser.add_argument("--smoke", action="store_true")
    parser.add_argument("--frames", type=int, help="frames of each cloth")
    parser.add_argument("--timeout", type=float, default=900.0, help="seconds for each run")
    parser.add_argument("--threads", type=int, help="of the cloth engines that can be told")
    parser.add_argument("--cases", help="more faces: `fabrig bench registration --write FOLDER`")
    parser.add_argument("--count", type=int, help="only the first so many faces")
    parser.add_argument("--json", type=pathlib.Path, default=FOLDER / "results.json")
    args = parser.parse_args()
    found = {
        "machine": {
            "processor": platform.processor() or platform.machine(),
            "threads": os.cpu_count(),
            "load": os.getloadavg() if hasattr(os, "getloadavg") else None,
        }
    }
    if args.only != "cloth" and not args.smoke:
        import registration

        found["registration"] = registration.run(args.cases, args.count)
        print(registration.table(found["registration"]))
    if args.only != "registration":
        found["cloth"] = cloth(args)
    args.json.write_text(json.dumps(found, indent=2) + "\n")
    ours = [r for r in found.get("cloth", []) if r["engine"].startswith("fabrig")]
    sys.exit(any(r["state"] != "ran" for r in ours))


if __name__ == "__main__":
    main()
