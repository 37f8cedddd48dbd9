#!/usr/bin/env python3
"""Draws the pictures of the reference: one for each shape, one for each preset of materials.

    cargo build --release
    docs/guide/pictures/make.py --gridfall target/release/gridfall --work /somewhere            # all, minutes on two cores
    docs/guide/pictures/make.py --gridfall target/release/gridfall --work /somewhere steel torus

It runs small scenes and draws their last frames, both with the program. Shapes are the examples of the scene's schema.
Materials are those whose pictures docs/PRESETS.md and docs/guide/scene.md show, at the speeds that these pages name.
ffmpeg, which films need too, reduces the pictures to as many colours as fit into 24 kB. The scenes stay in --work.
"""

import argparse
import json
import os
import pathlib
import re
import subprocess

HERE = pathlib.Path(__file__).resolve().parent
ROOT = HERE.parents[2]
SIZE = "360x240"
MOST_BYTES = 24_000
WALL = {"contact": "separate", "friction": 0.4}


def main():
    arguments = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    arguments.add_argument("--gridfall", default="gridfall", help="the program")
    arguments.add_argument("--work", type=pathlib.Path, required=True, help="folder for scenes and recordings")
    arguments.add_argument("--keep", action="store_true", help="do not run what has been run and is as it was")
    arguments.add_argument("names", nargs="*", help="shapes and materials; all by default")
    arguments = arguments.parse_args()
    arguments.work.mkdir(parents=True, exist_ok=True)
    schema = json.loads((ROOT / "api" / "scene.schema.json").read_text())
    (arguments.work / "star.obj").write_text(star())
    scenes = [(HERE / "shapes" / name, *of_shape(name, example)) for name, example in shapes(schema)]
    scenes += [(HERE / "materials" / name, *of_material(*rest)) for name, *rest in materials(schema)]
    for path, scene, camera in scenes:
        if path.name in arguments.names or not arguments.names:
            size = draw(arguments, path.with_suffix(".png"), scene, camera)
            print(f"{path.name}: {size} bytes", flush=True)


def draw(arguments, picture, scene, camera):
    """Runs a scene and draws its last frame."""
    stem = arguments.work / f"{picture.parent.name}-{picture.stem}"
    files = {end: f"{stem}.{end}" for end in ("json", "mcap", "png")}
    text, before = json.dumps(scene, indent=1) + "\n", pathlib.Path(files["json"])
    kept = arguments.keep and pathlib.Path(files["mcap"]).exists() and before.read_text() == text
    before.write_text(text)
    gridfall = [arguments.gridfall, "--quiet"]
    frames = ["--frames", "1"] if picture.parent.name == "shapes" else []
    # Drivers that find nothing there would say so again and again.
    environment = {"XDG_RUNTIME_DIR": "/tmp", **os.environ}
    run = [*gridfall, "run", files["json"], "-o", files["mcap"], "--backend", "cpu", *frames]
    if not kept:
        subprocess.run(run, check=True, env=environment)
    frame = ["--frame", "0"] if frames else []
    look = ["--size", SIZE, "--camera", camera, *frame]
    subprocess.run([*gridfall, "render", files["mcap"], "-o", files["png"], *look], check=True, env=environment)
    picture.parent.mkdir(exist_ok=True)
    for colours in (128, 96, 64, 48, 32, 24, 16):
        reduce = f"split[a][b];[a]palettegen=max_colors={colours}:reserve_transparent=0[p];[b][p]paletteuse=dither=none"
        subprocess.run(["ffmpeg", "-v", "error", "-y", "-i", files["png"], "-vf", reduce, picture], check=True)
        if picture.stat().st_size <= MOST_BYTES:
            break
    return picture.stat().st_size


# --- shapes


def shapes(schema):
    """Names of shapes, with their examples."""
    for name, node in schema["$defs"]["Shape"]["properties"].items():
        place = schema["$defs"][node["$ref"].rsplit("/", 1)[1]] if "$ref" in node else node
        yield name, place["examples"][0]


def of_shape(name, example):
    shape, bodies, colliders = {name: example}, [], []
    if name == "half-space":
        # It has no bounds, so it is no body. What lies on it shows where it is.
        colliders = [{"name": "plane", "contact": "sticky", "shape": shape}]
        shape = {"difference": [{"box": {"min": [0.35, 0.35, 0.05], "max": [0.65, 0.65, 0.5]}}, shape]}
    if name == "shell":
        # Cut open.
        shape = {"difference": [shape, {"half-space": {"point": [0.5, 0.45, 0.4], "normal": [-0.5, 0.8, -0.6]}}]}
    if name in ("translate", "rotate", "scale"):
        bodies.append({"name": "before", "material": "first", "shape": example["shape"]})
    bodies.append({"name": name, "material": "second", "shape": shape})
    material = {"model": "neo-hookean", "density": 1000, "youngs_modulus": 1e6, "poissons_ratio": 0.3}
    scene = {
        "gridfall": 1, "name": name, "description": f"The shape {name}.", "gravity": [0, 0, -9.81],
        "domain": {"min": [0, 0, 0], "max": [1.2, 1, 0.8], "dx": 0.02},
        "materials": {"first": material, "second": material},
        "bodies": [{"particles_per_cell": 8, "sampling": "conforming", **body} for body in bodies],
        "colliders": colliders, "time": {"end": 1e-4, "frame_rate": 1e4}, "solver": {"integrator": "explicit"},
    }
    return scene, "azimuth=-60,elevation=24,look_at=0.5,0.5,0.28,distance=2.5"


def star():
    """A star of five points, as a mesh in the form OBJ."""
    from math import cos, pi, sin

    rim = [(0.5 + r * cos(pi * n / 5), 0.5 + r * sin(pi * n / 5)) for n in range(10) for r in [(0.38, 0.16)[n % 2]]]
    corners = [(x, y, z) for z in (0.1, 0.35) for x, y in rim] + [(0.5, 0.5, 0.1), (0.5, 0.5, 0.35)]
    lines = ["v %.6f %.6f %.6f" % corner for corner in corners]
    for n in range(10):
        a, b = n + 1, (n + 1) % 10 + 1
        for face in ((b, a, 21), (a + 10, b + 10, 22), (a, b, b + 10), (a, b + 10, a + 10)):
            lines.append("f %d %d %d" % face)
    return "\n".join(lines) + "\n"


# --- materials


def materials(schema):
    """Names of materials that pages have pictures of, what they are in a scene, and the speed of the block (m/s)."""
    presets = schema["$defs"]["PresetName"]["enum"]
    own = {node["properties"]["model"]["const"]: node["examples"][0] for name, node in schema["$defs"].items()
           if name.endswith("Material") and name != "Material"}
    pages = "".join((ROOT / page).read_text() for page in ("docs/PRESETS.md", "docs/guide/scene.md"))
    found = re.findall(r"!\[([\w-]+) at ([\d.]+) m/s\]\((?:guide/)?pictures/materials/", pages)
    for name, speed in dict(found).items():
        yield name, {"preset": name} if name in presets else own[name], float(speed)


def of_material(material, speed):
    way = 0.3
    scene = {
        "gridfall": 1, "name": "block", "description": "A block hits a ball that does not move.",
        "domain": {"min": [0, 0, 0], "max": [1, 0.8, 0.5], "dx": 0.02, "boundary": {"x": WALL, "y": WALL, "z-": WALL}},
        "gravity": [0, 0, -9.81],
        "bodies": [{
            "name": "block", "material": material, "velocity": [0, 0, -speed],
            "shape": {"box": {"min": [0.4, 0.3, 0.14], "max": [0.6, 0.5, 0.34]}},
        }],
        "colliders": [{"name": "ball", **WALL, "shape": {"sphere": {"center": [0.47, 0.4, 0.05], "radius": 0.08}}}],
        "time": {"end": way / speed, "frame_rate": 4 * speed / way},
        "solver": {"integrator": "explicit", "max_dt": way / speed / 200},
    }
    return scene, "azimuth=-60,elevation=22,look_at=0.49,0.4,0.15,distance=1.9"


if __name__ == "__main__":
    main()
