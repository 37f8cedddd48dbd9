#!/usr/bin/env python3
"""Plots and tables of docs/BENCHMARKS.md from runs of `gridfall bench implicit`, after figures of the HOT paper (Wang et al. 2020).

    gridfall bench implicit --json > implicit.json
    gridfall bench implicit --scenes wheel --frames 1 --tolerances 1e-2,1e-3,1e-4,1e-5,1e-6,1e-7,1e-8,1e-9 --json > wheel.json
    python3 docs/benchmarks/plot.py implicit.json wheel.json docs/benchmarks

Needs matplotlib. Any number of JSON files, then the folder for the pictures; what the rows allow is drawn:
speed-up.png (Fig. 15: total, and largest of a frame), convergence.png (Fig. 17: iterations and time it takes to come to a tolerance),
stiffness.png (Fig. 20: iterations and time against the stiffness of the middle). Prints the speed-ups, and Table 3, as Markdown.
"""

import json
import pathlib
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt

REFERENCE = "hot"
SWEEP = "stiffness-sweep"
USUAL = 1e-7


def key(row):
    return row["scene"], row["variant"], row["kernel"], row["engine"]


def tolerance(row):
    part = [p for p in row["variant"].split(", ") if p.startswith("ε ")]
    return float(part[0][2:]) if part else USUAL


def references(rows):
    return {key(row): row for row in rows if row["method"] == REFERENCE}


def unique(values):
    return list(dict.fromkeys(values))


def save(plot, path):
    plot.tight_layout()
    plot.savefig(path)
    plt.close(plot)
    print(f"wrote {path}", file=sys.stderr)


def speed_up(rows, out):
    """How many times as long as HOT each method takes, in all and in the frame where that is most; hatched where it did not converge."""
    found = references(rows)
    rows = [r for r in rows if r["scene"] != SWEEP and tolerance(r) == USUAL and r["kernel"] == "quadratic" and key(r) in found]
    methods = unique(r["method"] for r in rows if r["method"] != REFERENCE)
    scenes = unique(r["scene"] for r in rows)
    if not methods:
        return
    plot, axes = plt.subplots(2, 1, figsize=(10, 6.4), dpi=100, sharex=True)
    for m, method in enumerate(methods):
        for row in (r for r in rows if r["method"] == method):
            hot = found[key(row)]
            place = scenes.index(row["scene"]) + 0.8 * ((m + 0.5) / len(methods) - 0.5)
            frames = [a / b for a, b in zip(row["frame_time_s"], hot["frame_time_s"]) if b > 0]
            look = {"width": 0.8 / len(methods), "color": f"C{m % 10}", "hatch": None if row["converged"] else "////"}
            axes[0].bar(place, row["time_s"] / hot["time_s"], **look)
            axes[1].bar(place, max(frames, default=0), **look)
        axes[0].bar(0, 0, color=f"C{m % 10}", label=method)
    for ax, title in zip(axes, ("time over HOT's, in all", "largest of a frame")):
        ax.axhline(1, color="k", linewidth=0.8)
        ax.set(ylabel=title, yscale="log")
        ax.grid(alpha=0.3, axis="y")
    axes[0].legend(fontsize=7, ncols=5)
    axes[1].set_xticks(range(len(scenes)), scenes, rotation=20)
    save(plot, out / "speed-up.png")


def convergence(rows, out):
    """Outer iterations and time until a residual is reached."""
    rows = [r for r in rows if r["kernel"] == "quadratic" and r["converged"]]
    many = [s for s in unique((r["scene"], r["variant"].split(", ")[0] if r["scene"] == SWEEP else "") for r in rows)
            if len({tolerance(r) for r in rows if r["scene"] == s[0]}) > 2]
    if not many:
        return
    scene = many[0][0]
    rows = [r for r in rows if r["scene"] == scene]
    plot, axes = plt.subplots(1, 2, figsize=(10, 3.8), dpi=100, sharey=True)
    for method in unique(r["method"] for r in rows):
        points = sorted(((tolerance(r), r) for r in rows if r["method"] == method), key=lambda p: -p[0])
        for ax, value in zip(axes, ("outer_iterations", "time_s")):
            ax.plot([r[value] for _, r in points], [e for e, _ in points], "o-", markersize=3, linewidth=1.2, label=method)
    for ax, label in zip(axes, ("outer iterations", "time (s)")):
        ax.set(xlabel=label, yscale="log", xscale="log", title=f"{scene}, first frame")
        ax.grid(alpha=0.3)
    axes[0].set_ylabel("residual in the characteristic norm")
    axes[0].legend(fontsize=7)
    save(plot, out / "convergence.png")


def stiffness(rows, out):
    """Iterations and time a step against the modulus of the middle."""
    rows = [r for r in rows if r["scene"] == SWEEP and tolerance(r) == USUAL and r["steps"]]
    if not rows:
        return
    plot, axes = plt.subplots(1, 2, figsize=(10, 3.8), dpi=100)
    for method, kernel, engine in unique((r["method"], r["kernel"], r["engine"]) for r in rows):
        points = [r for r in rows if (r["method"], r["kernel"], r["engine"]) == (method, kernel, engine)]
        x = [float(r["variant"].split(", ")[0]) for r in points]
        label = method + ("" if kernel == "quadratic" else f", {kernel}") + ("" if engine == "cpu" else f", {engine}")
        for ax, value in zip(axes, ("outer_iterations", "time_s")):
            ax.plot(x, [r[value] / r["steps"] for r in points], "o-" if kernel == "quadratic" else "s--", markersize=3, linewidth=1.2, label=label)
    for ax, label in zip(axes, ("outer iterations a step", "time a step (s)")):
        ax.set(xlabel="Young's modulus of the middle (Pa)", ylabel=label, xscale="log", yscale="log")
        ax.grid(alpha=0.3)
    axes[0].legend(fontsize=7)
    save(plot, out / "stiffness.png")


def ratios(rows):
    found = references(rows)
    print("| scene | variant | kernel | method | steps | time (s) | outer per step | inner per step | time / hot's | converged |")
    print("|---|---|---|---|---|---|---|---|---|---|")
    for row in rows:
        steps = max(1, row["steps"])
        ratio = f"{row['time_s'] / found[key(row)]['time_s']:.2f}" if key(row) in found else "—"
        print(f"| {row['scene']} | {row['variant']} | {row['kernel']} | {row['method']} | {row['steps']} | {row['time_s']:.1f} | "
              f"{row['outer_iterations'] / steps:.1f} | {row['inner_iterations'] / steps:.1f} | {ratio} | {'yes' if row['converged'] else '**no**'} |")


def table_3(rows):
    rows = [r for r in rows if tolerance(r) == USUAL and r["kernel"] == "quadratic" and r["steps"] and not (r["scene"] == SWEEP)]
    by = {(r["scene"], r["method"]): r for r in rows}
    scenes = [s for s in unique(r["scene"] for r in rows) if all((s, m) in by for m in ("pn-pcg", "pn-pcg-sgs"))]
    if not scenes:
        return
    print("\n| scene | Gauss–Seidel: s per step | CG iterations per step | Jacobi: s per step | CG iterations per step |")
    print("|---|---|---|---|---|")
    for scene in scenes:
        cells = [f"{by[scene, m][v] / by[scene, m]['steps']:.2f}" for m in ("pn-pcg-sgs", "pn-pcg") for v in ("time_s", "inner_iterations")]
        print(f"| {scene} | " + " | ".join(cells) + " |")


def main():
    *files, out = map(pathlib.Path, sys.argv[1:])
    rows = [row for path in files for row in json.loads(path.read_text())]
    for draw in (speed_up, convergence, stiffness):
        draw(rows, out)
    ratios(rows)
    table_3(rows)


if __name__ == "__main__":
    main()
