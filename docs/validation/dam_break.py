#!/usr/bin/env python3
"""The picture of the dam break in docs/VALIDATION.md, from two recordings of one scene in the plane.

    python3 docs/validation/dam_break.py before.mcap after.mcap docs/validation/dam-break.png

Needs matplotlib, numpy, mcap and mcap-protobuf-support.
"""

import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from fracture import frames

TIMES_S = (0, 1, 5, 20)
WIDTH_M, LEVEL_M, HEIGHT_M = 1.6, 0.2, 0.85


def positions(path):
    """Positions of all particles at each of the times."""
    return {wanted: x for time, x in frames(path) for wanted in TIMES_S if abs(wanted - time) < 1e-6}


def main():
    plot, axes = plt.subplots(len(TIMES_S), 2, figsize=(8, 9), sharex=True, sharey=True, dpi=90)
    for column, (title, path) in enumerate(zip(("before", "after"), sys.argv[1:3])):
        found = positions(path)
        for row, time in enumerate(TIMES_S):
            panel = axes[row][column]
            panel.scatter(found[time][:, 0], found[time][:, 1], s=3, linewidths=0)
            panel.axhline(LEVEL_M, color="k", linestyle="--", linewidth=0.8)
            panel.set(xlim=(0, WIDTH_M), ylim=(0, HEIGHT_M), aspect="equal", title=f"{title}, {time} s")
    plot.tight_layout()
    plot.savefig(sys.argv[3])


if __name__ == "__main__":
    main()
