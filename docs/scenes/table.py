#!/usr/bin/env python3
"""Runs the scenes of scenes/ and writes docs/SCENES.md: what each costs, what it conserves, and what was seen.

    docs/scenes/table.py --gridfall target/release/gridfall --runs /somewhere            # all scenes, minutes on two cores
    docs/scenes/table.py --gridfall target/release/gridfall --runs /somewhere oreo-drop-small
    docs/scenes/table.py --runs /somewhere --keep                                        # only write the page again

Runs keep their recording, diagnostics and summary in the folder of --runs; with --keep, scenes that have them are not run again. Scenes
with a reduced variant (NAME-small for NAME and NAME-SIZE) are not run but costed: particles above a million are counted on cells that
are four times as wide, and the step is that of a few particles of each body. Verdicts are a person's: docs/scenes/verdicts.json.
"""

import argparse
import copy
import csv
import json
import math
import pathlib
import subprocess
import textwrap

ROOT = pathlib.Path(__file__).resolve().parents[2]
PAGE = ROOT / "docs" / "SCENES.md"
VERDICTS = ROOT / "docs" / "scenes" / "verdicts.json"
# From here on the page is kept as it is.
BY_HAND = "\n## Implicit\n"
WIDER = 4


def main():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--gridfall", default="gridfall", help="the program")
    arguments.add_argument("--runs", type=pathlib.Path, required=True, help="folder for recordings and diagnostics")
    arguments.add_argument("--build", default="", help="what the program was built from, for the page")
    arguments.add_argument("--keep", action="store_true", help="do not run what has been run")
    arguments.add_argument("scenes", nargs="*", help="names; all by default")
    arguments = arguments.parse_args()
    arguments.runs.mkdir(parents=True, exist_ok=True)
    scenes = {path.stem: json.loads(path.read_text()) for path in sorted((ROOT / "scenes").glob("*.json"))}
    for name, scene in scenes.items():
        summary = arguments.runs / f"{name}.json"
        wanted = name in arguments.scenes or not (arguments.scenes or arguments.keep and summary.exists())
        if wanted:
            print(name, flush=True)
            made = cost(arguments.gridfall, scene) if is_large(name, scenes) else run(arguments, name, scene)
            summary.write_text(json.dumps(made, indent=1) + "\n")
    by_hand = PAGE.read_text().partition(BY_HAND)[1:] if PAGE.exists() else ()
    PAGE.write_text(page(arguments.runs, scenes, arguments.build) + "".join(by_hand))


def is_large(name, scenes):
    bases = [other.removesuffix("-small") for other in scenes if other.endswith("-small")]
    return not name.endswith("-small") and any(name.startswith(base) for base in bases)


# --- running


def gridfall(program, *arguments, scene=None):
    """Exit code, standard output as JSON, standard error."""
    text = None if scene is None else json.dumps(scene)
    done = subprocess.run([program, *arguments], input=text, capture_output=True, text=True)
    return done.returncode, json.loads(done.stdout) if done.stdout.strip() else {}, done.stderr.strip()


def check(program, scene):
    code, answer, errors = gridfall(program, "check", "-", "--json", "--backend", "cpu", scene=scene)
    if code != 0:
        raise SystemExit(f"{scene['name']}: {errors}")
    return answer


def run(arguments, name, scene):
    files = {kind: str(arguments.runs / f"{name}.{kind}") for kind in ("mcap", "csv")}
    path = str(ROOT / "scenes" / f"{name}.json")
    code, summary, errors = gridfall(
        arguments.gridfall, "run", path, "-o", files["mcap"], "--diagnostics", files["csv"], "--json", "--backend", "cpu"
    )
    estimate = check(arguments.gridfall, scene)["estimate"]
    failure = None if code == 0 else errors.splitlines()[-1]
    return {"summary": summary, "estimate": estimate, "failure": failure}


def cost(program, scene):
    """Particles, step and steps of a scene that is too large to be run, or even sampled, here."""
    wider = copy.deepcopy(scene)
    wider["domain"]["dx"] *= WIDER
    dimension = scene.get("dimension", 3)
    particles = check(program, wider)["estimate"]["particles"] * WIDER**dimension
    if particles < 1_000_000:
        return {"estimate": check(program, scene)["estimate"]}
    few = copy.deepcopy(scene)
    domain = few["domain"]
    for body in few["bodies"]:
        # Two cells in the middle of the domain, filled like the body: material, speed and deformation set the step.
        middle = [(a + b) / 2 for a, b in zip(domain["min"], domain["max"])]
        corner = [a + math.floor((m - a) / domain["dx"]) * domain["dx"] for a, m in zip(domain["min"], middle)]
        body["shape"] = {"box": {"min": corner, "max": [c + 2 * domain["dx"] for c in corner]}}
        body["sampling"] = "regular"
        body["particles_per_cell"] = 8 if dimension == 3 else 4
        body.pop("grips", None)
    return {"estimate": {**check(program, few)["estimate"], "particles": particles}}


# --- reading


def drifts(path, scene):
    """Largest changes over a run as shares of what there is; None where the scene does not conserve it."""
    rows = [{k: float(v) for k, v in row.items() if v} for row in csv.DictReader(path.open())]
    first = rows[0]
    mass = max(abs(row["mass_kg"] - first["mass_kg"]) for row in rows) / first["mass_kg"]
    free = not (scene.get("gravity") or scene.get("colliders") or is_held(scene))
    worked = any(body.get("grips") for body in scene["bodies"]) or any("motion" in c for c in scene.get("colliders", []))
    kinetic = max(row["kinetic_j"] for row in rows)
    scale = math.sqrt(2 * first["mass_kg"] * kinetic)
    vector = lambda row, name: [row[f"{name}_{axis}"] for axis in "xyz"]
    change = lambda name: max(math.dist(vector(row, name), vector(first, name)) for row in rows)
    energy = [row["kinetic_j"] + row["strain_j"] + row["gravity_j"] for row in rows]
    most = max(row["kinetic_j"] + row["strain_j"] for row in rows)
    size = max(b - a for a, b in zip(scene["domain"]["min"], scene["domain"]["max"]))
    return {
        "mass": mass,
        "momentum": change("momentum") / scale if free else None,
        "angular": change("angular_momentum") / (scale * size) if free else None,
        "gain": None if worked else (max(energy) - energy[0]) / most,
        "end": None if worked else (energy[-1] - energy[0]) / most,
        "reset": sum(row.get("isolated_reset", 0) for row in rows),
        "dt": sum(row["dt_s"] * row["steps"] for row in rows) / max(1, sum(row["steps"] for row in rows)),
    }


def is_held(scene):
    """Whether a body is gripped, or is a box that begins at a wall."""
    domain = scene["domain"]
    boxes = [body["shape"]["box"] for body in scene["bodies"] if "box" in body["shape"]]
    ends = [pair for box in boxes for end in ("min", "max") for pair in zip(box[end], domain[end])]
    return any(body.get("grips") for body in scene["bodies"]) or any(math.isclose(a, b) for a, b in ends)


# --- writing


def number(value, digits=2):
    return "—" if value is None else f"{value:.{digits}g}" if value else "0"


def seconds(value):
    return f"{value:.2e}" if value < 1e-2 else f"{value:.2g}"


def bound(estimate):
    return f"{seconds(estimate['dt_limits'][0]['dt_s'])}, {estimate['dt_bound']}"


def page(runs, scenes, build):
    verdicts = json.loads(VERDICTS.read_text()) if VERDICTS.exists() else {}
    made = {name: runs / f"{name}.json" for name in scenes}
    made = {name: json.loads(path.read_text()) for name, path in made.items() if path.exists()}
    text = HEAD
    device = next((m["summary"]["backend"]["device"] for m in made.values() if m.get("summary")), "unknown")
    text += f"\n## Runs on {device}\n\n" + (build and textwrap.fill(build, 100) + "\n\n") + RUN_HEAD
    for name, m in made.items():
        if "summary" not in m:
            continue
        table = runs / f"{name}.csv"
        d = drifts(table, scenes[name]) if table.exists() and table.stat().st_size else {}
        s, e = m["summary"], m["estimate"]
        frames = s.get("frames_written", 1) - 1
        cells = [
            name,
            f"{e['particles']:,}",
            f"{seconds(d['dt']) if d else '—'} (≤ {bound(e)})",
            f"{s.get('steps', 0):,}",
            number(s["wall_s"] / frames if frames > 0 else None),
            number(d.get("mass")),
            number(d.get("momentum")),
            number(d.get("angular")),
            f"{number(d.get('gain'))}, {number(d.get('end'))}",
            f"{d.get('reset', 0):.0f}",
            verdicts.get(name, "") + (f" **Failed:** {m['failure']}" if m["failure"] else ""),
        ]
        text += "| " + " | ".join(cells) + " |\n"
    text += "\n## Not run: too large for the machine above\n\n" + COST_HEAD
    for name, m in made.items():
        if "summary" in m:
            continue
        e = m["estimate"]
        cells = [name, f"{e['particles']:,}", f"{seconds(e['dt_s'])} (≤ {bound(e)})", f"{e['steps']:,}", verdicts.get(name, "")]
        text += "| " + " | ".join(cells) + " |\n"
    return text


HEAD = """# Scenes

[scenes/table.py](scenes/table.py) writes this page. It runs every scene that two cores can run and
estimates the cost of the others. Each scene's `description` says what to look for. A verdict says
what a person saw in the frames and the diagnostics ([scenes/verdicts.json](scenes/verdicts.json)).
"""

RUN_HEAD = """- Step: the mean over the run and, in brackets, the limit that applied at time 0, before frames are
  divided into equal steps.
- Mass: the largest relative change.
- Momentum and angular momentum, only for bodies in free space: the largest change relative to what
  the motion of the bodies could carry (sqrt(2 m E); for angular momentum, times the domain's size).
- Energy (kinetic, strain, gravity), only where no external work is done on the bodies: the largest
  gain, and the change at the end, both relative to the largest kinetic plus strain energy.
  Friction, inelastic contact, plastic flow and transfers dissipate energy.
- Resets: isolated particles whose strain was reset.
- Times are from a machine that also did other work.

| scene | particles | step (s) | steps | s per frame | mass | momentum | angular momentum | energy: gain, end | resets | verdict |
|---|---|---|---|---|---|---|---|---|---|---|
"""

COST_HEAD = """These scenes were not run here. Particles above a million are counted on cells four times as wide
(± 1 %). The step is the one at time 0, and the number of steps assumes it for the whole run.

| scene | particles | step (s) | steps | note |
|---|---|---|---|---|
"""

if __name__ == "__main__":
    main()
