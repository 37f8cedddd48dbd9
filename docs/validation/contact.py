#!/usr/bin/env python3
"""The pictures of contact in docs/VALIDATION.md: a thin plate under water, a disc on a slope, two blocks. Runs the scenes on the CPU.

    python3 docs/validation/contact.py gridfall docs/validation [plate|disc|blocks ...]

Needs matplotlib, numpy, mcap and mcap-protobuf-support.
"""

import copy
import json
import math
import pathlib
import subprocess
import sys
import tempfile

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from fracture import frames

BLUE, RED, GREY = "tab:blue", "tab:red", "0.55"
SLOPE = math.radians(30)
DOWN_30 = [9.81 * math.sin(SLOPE), -9.81 * math.cos(SLOPE)]


def run(gridfall, scene):
    """Times (s) and positions (n, 3) of the frames of a scene."""
    with tempfile.TemporaryDirectory() as folder:
        path, out = pathlib.Path(folder, "scene.json"), pathlib.Path(folder, "out.mcap")
        path.write_text(json.dumps(scene))
        subprocess.run([gridfall, "run", path, "-o", out, "--backend", "cpu"], check=True, capture_output=True)
        times, positions = zip(*frames(out))
    return np.array(times), positions


def elastic(youngs_modulus, **more):
    return {"model": "neo-hookean", "density": 1000, "youngs_modulus": youngs_modulus, "poissons_ratio": 0.3, **more}


def scene(size, dx, gravity, material, bodies, end, rate, colliders=(), contact="particles", boundary="slip"):
    walls = {axis: {"contact": boundary} for axis in "xy"}
    return {
        "gridfall": 1, "name": "contact", "dimension": 2, "gravity": gravity, "materials": {"m": material},
        "domain": {"min": [0, 0], "max": size, "dx": dx, "boundary": walls},
        "bodies": [{"material": "m", **body} for body in bodies], "colliders": list(colliders),
        "solver": {"integrator": "explicit", "contact": contact}, "time": {"end": end, "frame_rate": rate},
    }


def at(times, positions, wanted):
    return positions[int(np.argmin(abs(times - wanted)))]


def turned(positions):
    """Angle (rad) of the best rotation from the first frame to each."""
    start = positions[0][:, :2] - positions[0][:, :2].mean(0)
    angles = []
    for x in positions:
        now = x[:, :2] - x[:, :2].mean(0)
        angles.append(np.arctan2((start[:, 0] * now[:, 1] - start[:, 1] * now[:, 0]).sum(), (start * now).sum()))
    return np.unwrap(angles)


def save(plot, path):
    plot.tight_layout()
    plot.savefig(path)
    plt.close(plot)
    print(f"wrote {path}", file=sys.stderr)


def plate(gridfall, path):
    dx, top = 0.0125, 0.4 + 0.625 * 0.0125
    low = top - 0.2 * dx
    water = {"model": "weakly-compressible-fluid", "density": 1000, "bulk_modulus": 1e5}
    body = {"name": "water", "shape": {"box": {"min": [0.2, 0.5], "max": [0.8, 0.8]}}}
    sheet = {"name": "plate", "contact": "slip", "shape": {"box": {"min": [-0.1, low], "max": [1.1, top]}}}
    times_s = (0, 0.25, 1, 5)
    plot, axes = plt.subplots(2, len(times_s), figsize=(9, 4.3), sharex=True, sharey=True, dpi=90)
    for row, (title, contact) in enumerate((("nodes", "nodes"), ("particles", "particles"))):
        times, positions = run(gridfall, scene([1, 1], dx, [0, -9.81], water, [body], 5, 20, [sheet], contact))
        for panel, time in zip(axes[row], times_s):
            x = at(times, positions, time)
            above = x[:, 1] > low
            panel.scatter(x[above, 0], x[above, 1], s=1.6, linewidths=0, color=BLUE)
            panel.scatter(x[~above, 0], x[~above, 1], s=1.6, linewidths=0, color=RED)
            panel.axhspan(low, top, color="k")
            panel.set(xlim=(0, 1), ylim=(0, 0.85), aspect="equal", title=f"{title}, {time} s")
            panel.text(0.5, 0.06 if above.all() else 0.76, f"{100 * (~above).mean():.0f} % through", ha="center", fontsize=9)
    plot.suptitle("Water on a plate of 0.2 dx; contact at nodes, at particles", fontsize=11)
    save(plot, path)


def disc(gridfall, path):
    right = {1.0: -2 / 3 * DOWN_30[0] / 0.2, 0.05: 2 * 0.05 * DOWN_30[1] / 0.2}
    body = {"name": "disc", "particles_per_cell": 9, "shape": {"sphere": {"center": [0.6, 0.3], "radius": 0.2}}}
    plot, axes = plt.subplots(2, 2, figsize=(9, 5.6), dpi=90, gridspec_kw={"width_ratios": (1.15, 1)})
    for sampling, row, colour in (("regular", 0, RED), ("conforming", 1, BLUE)):
        panel = axes[row][0]
        for friction, chart in ((1.0, axes[0][1]), (0.05, axes[1][1])):
            floor = {"name": "floor", "contact": "separate", "friction": friction,
                     "shape": {"box": {"min": [-1, -1], "max": [5, 0.1]}}}
            moving = scene([3.2, 0.8], 0.01, DOWN_30, elastic(1e7), [{**body, "sampling": sampling}], 0.5, 40, [floor])
            times, positions = run(gridfall, moving)
            angle = turned(positions)
            late = times >= 0.2
            found = 2 * np.polyfit(times[late], angle[late], 2)[0]
            chart.plot(times, -np.degrees(angle), color=colour, label=f"{sampling}: {-found:.2f} rad/s²")
            chart.set(title=f"on a slope of 30°, friction {friction:g}", xlabel="time (s)", ylabel="turned down the slope (°)")
            print(sampling, friction, f"{found:.3f} of {right[friction]:.3f} rad/s²", file=sys.stderr)
            if sampling == "conforming":
                chart.plot(times, -np.degrees(right[friction]) * times**2 / 2, "k--", linewidth=1,
                           label=f"right: {-right[friction]:.2f} rad/s²")
        x = positions[0]
        panel.scatter(x[:, 0], x[:, 1], s=9, linewidths=0, color=colour)
        arc = np.linspace(1.2 * math.pi, 1.8 * math.pi, 200)
        panel.plot(0.6 + 0.2 * np.cos(arc), 0.3 + 0.2 * np.sin(arc), color="k", linewidth=0.8)
        panel.axhspan(0.09, 0.1, color=GREY)
        panel.set(xlim=(0.5, 0.7), ylim=(0.095, 0.16), aspect="equal", title=f"{sampling}: the foot of the disc (m)")
    for chart in axes[:, 1]:
        chart.grid(alpha=0.3)
        chart.legend(fontsize=8)
    save(plot, path)


def blocks(gridfall, path):
    dx = 0.02
    slope = [9.81 * math.sin(math.radians(24)), -9.81 * math.cos(math.radians(24))]
    layer = {"name": "lower", "particles_per_cell": 9, "shape": {"box": {"min": [0, 0], "max": [1.6, 0.1]}}}
    block = {"name": "upper", "particles_per_cell": 9, "shape": {"box": {"min": [0.2, 0.1], "max": [0.52, 0.26]}}}
    lower = {"name": "lower", "particles_per_cell": 9, "shape": {"box": {"min": [0.3, 0], "max": [0.7, 0.3]}}}
    upper = {"name": "upper", "particles_per_cell": 9, "shape": {"box": {"min": [0.3, 0.3], "max": [0.7, 0.6]}},
             "grips": [{"name": "g", "shape": {"box": {"min": [0.25, 0.54], "max": [0.75, 0.65]}},
                        "motion": {"linear_velocity": [0, 0.2]}}]}
    sliding = scene([1.6, 0.4], dx, slope, elastic(1e6), [layer, block], 1, 20, boundary="sticky")
    parting = scene([1, 1.2], dx, [0, 0], elastic(1e5), [lower, upper], 1, 20, boundary="sticky")
    free = {"contact": "separate", "friction": math.tan(math.radians(15))}
    plot, axes = plt.subplots(2, 4, figsize=(11.5, 4.4), dpi=85, gridspec_kw={"width_ratios": (1.9, 1.9, 1, 1)})
    for row, title in ((0, "without contact"), (1, "contact: separate")):
        panels = iter(axes[row])
        for kind, start, ends, limits in (("slide", sliding, (0.5, 1.0), (1.6, 0.8)), ("pull", parting, (0.5, 1.0), (1, 1))):
            setup = copy.deepcopy(start)
            setup["bodies"][1].update(free if row else {})
            times, positions = run(gridfall, setup)
            first = (layer if kind == "slide" else lower)["shape"]["box"]["max"]
            below = positions[0][:, 1] < first[1]
            x0 = positions[0][~below].mean(0)
            for time in ends:
                panel, x = next(panels), at(times, positions, time)
                panel.scatter(x[below, 0], x[below, 1], s=3, linewidths=0, color=GREY)
                panel.scatter(x[~below, 0], x[~below, 1], s=3, linewidths=0, color=BLUE)
                way = x[~below].mean(0) - x0
                gap = x[~below, 1].min() - x[below, 1].max()
                text = f"slid {way[0]:.3f} m" if kind == "slide" else f"{gap:.3f} m apart" if row else "stuck"
                panel.set(xlim=(0, limits[0]), ylim=(0, limits[1]), aspect="equal", title=f"{title}, {time:g} s")
                panel.text(0.97, 0.95, text, transform=panel.transAxes, ha="right", va="top", fontsize=9)
                print(title, kind, time, text, file=sys.stderr)
                panel.title.set_fontsize(10)
    save(plot, path)


def main():
    gridfall, out, *only = sys.argv[1:]
    for name, draw in (("plate", plate), ("disc", disc), ("blocks", blocks)):
        if not only or name in only:
            draw(gridfall, pathlib.Path(out, f"contact-{name}.png"))


if __name__ == "__main__":
    main()
