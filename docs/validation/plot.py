#!/usr/bin/env python3
"""Plots and the table of docs/VALIDATION.md from a run of `gridfall verify`.

    gridfall verify --full --json --curves curves > verify.json
    python3 docs/validation/plot.py verify.json curves docs/validation

Needs matplotlib. Writes one PNG for each kind of curve that is there, and prints the rows as a Markdown table.
"""

import csv
import json
import pathlib
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt


def read(path):
    """Columns of a curve by name."""
    with open(path, newline="") as file:
        rows = list(csv.reader(file))
    return {name: [float(row[k]) for row in rows[1:]] for k, name in enumerate(rows[0])}


def curves(directory, case):
    """Curves of a case by what follows its name."""
    return {p.stem[len(case) + 1 :]: read(p) for p in sorted(directory.glob(f"{case}-*.csv"))}


def figure(title, x, y):
    plot, axes = plt.subplots(figsize=(6.4, 3.6), dpi=100)
    axes.set(title=title, xlabel=x, ylabel=y)
    axes.grid(alpha=0.3)
    return plot, axes


def save(plot, axes, path):
    axes.legend(fontsize=8)
    plot.tight_layout()
    plot.savefig(path)
    plt.close(plot)
    print(f"wrote {path}", file=sys.stderr)


def lines(found, out, case, title, x, y, scale=1.0, log=False):
    """All columns of all curves of a case against their first one."""
    if not found:
        return
    plot, axes = figure(title, x, y)
    for name, columns in found.items():
        (first, time), *rest = columns.items()
        for label, values in rest:
            quantity = label.rsplit("_m", 1)[0]
            text = quantity if len(found) == 1 else name if len(rest) == 1 else f"{name} {quantity}"
            style = "k--" if label in ("exact_m", "free_m", "expected") else "-"
            axes.plot(time, [scale * v for v in values], style, label=text.replace("_", " "), linewidth=1.2)
    if log:
        axes.set_yscale("log")
    save(plot, axes, out / f"{case}.png")


def ratios(rows, out):
    """Largest stable factor over the expected one."""
    rows = [row for row in rows if row["case"] == "von-neumann" and row["got"] is not None]
    if not rows:
        return
    plot, axes = plt.subplots(figsize=(6.4, 5.4), dpi=100)
    for kind, colour in (("f, midway between nodes", "tab:blue"), ("f = largest stable dt c / dx", "tab:orange")):
        points = [(k, row) for k, row in enumerate(rows) if row["quantity"] == kind]
        axes.plot([100 * (r["got"] / r["expected"] - 1) for _, r in points], [k for k, _ in points], "o", color=colour,
                  label="Fig. 4" if colour == "tab:blue" else "against the compact kernel's bound")
    axes.set_yticks(range(len(rows)), [row["variant"] for row in rows], fontsize=7)
    axes.invert_yaxis()
    axes.axvspan(-1, 1, color="green", alpha=0.1)
    axes.axvline(0, color="k", linewidth=0.8)
    axes.set(title="Largest stable step of a periodic box", xlabel="got against expected (%)", xlim=(-2.2, 2.2))
    axes.grid(alpha=0.3)
    save(plot, axes, out / "von-neumann.png")


def convergence(found, out):
    """Distance of implicit runs from an explicit one by their number of steps, in two logarithms."""
    if not found:
        return
    plot, axes = figure("Three eighths of a swing of a bar: implicit against explicit", "steps", "rms distance / length")
    for name, columns in found.items():
        axes.loglog(columns["steps"], columns["position_error_over_length"], "o-", label=name, linewidth=1.2)
    last = columns["position_error_over_length"][-1] * columns["steps"][-1]
    axes.loglog(columns["steps"], [last / n for n in columns["steps"]], "k--", label="first order", linewidth=1.0)
    save(plot, axes, out / "implicit-convergence.png")


def number(value):
    if value is None:
        return "none"
    if value == 0 or 1e-3 <= abs(value) < 1e6:
        return f"{value:.5g}"
    return f"{value:.2e}"


def table(report):
    print("| case | engine | variant | quantity | expected | got | tolerance | |")
    print("|---|---|---|---|---|---|---|---|")
    for row in report["rows"]:
        tolerance = {"relative": f"± {100 * row['tolerance']:g} %", "absolute": f"± {row['tolerance']:g}",
                     "at-most": "at most", "at-least": "at least"}[row["rule"]]
        unit = f" {row['unit']}" if row["unit"] else ""
        print(f"| {row['case']} | {row['engine']} | {row['variant']} | {row['quantity']} | {number(row['expected'])}{unit} "
              f"| {number(row['got'])} | {tolerance} | {'pass' if row['pass'] else '**fails**'} |")


def main():
    report = json.loads(pathlib.Path(sys.argv[1]).read_text())
    directory, out = pathlib.Path(sys.argv[2]), pathlib.Path(sys.argv[3])
    ratios(report["rows"], out)
    seconds = "time (s)"
    lines(curves(directory, "colliding-spheres"), out, "colliding-spheres", "Two spheres collide: momentum / one sphere's", seconds, "p / p0")
    lines(curves(directory, "rotating-rod"), out, "rotating-rod", "Rotating rod: drift of angular momentum", seconds, "relative drift", log=True)
    lines(curves(directory, "sliding-block"), out, "sliding-block", "Block on a slope of 24°, friction tan 15°", seconds, "way (m)")
    lines(curves(directory, "cantilever"), out, "cantilever", "Cantilever let go under its own weight", seconds, "tip deflection (m)")
    lines(curves(directory, "sticky-floor"), out, "sticky-floor", "Jelly cube on a sticky floor: height of its roof", seconds, "height (m)")
    lines(curves(directory, "hollow-cylinder"), out, "hollow-cylinder", "Ball in a hollow cylinder: way fallen", seconds, "way (m)")
    lines(curves(directory, "granular-column-run-out"), out, "granular-column", "Collapse of a granular column", "aspect ratio", "run-out / initial length")
    lines(curves(directory, "implicit-cantilever"), out, "implicit-cantilever", "Cantilever, implicit Euler", seconds, "tip deflection (m)")
    lines(curves(directory, "sheared-layer"), out, "sheared-layer", "Elastic layer between sticky walls", seconds, "way of its middle (m)")
    convergence(curves(directory, "implicit-convergence"), out)
    table(report)


if __name__ == "__main__":
    main()
