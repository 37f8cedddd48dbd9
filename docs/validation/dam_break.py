#!/usr/bin/env python3
"""The picture of the dam break in docs/VALIDATION.md, from two recordings of one scene in the plane.

    python3 docs/validation/dam_break.py before.mcap after.mcap docs/validation/dam-break.png

Needs matplotlib, mcap and mcap-protobuf-support.
"""

import sys

import matplotlib
import numpy

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

TIMES_S = (0, 1, 5, 20)
WIDTH_M, LEVEL_M, HEIGHT_M = 1.6, 0.2, 0.85


def positions(path):
    """x and y of all particles at each of the times."""
    found = {}
    with open(path, "rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for _, _, message, points in reader.iter_decoded_messages(topics=["/particles"]):
            time = min(TIMES_S, key=lambda t: abs(t - message.log_time * 1e-9))
            if abs(time - message.log_time * 1e-9) < 1e-6:
                data = numpy.frombuffer(points.data, numpy.uint8).reshape(-1, points.point_stride)
                found[time] = data[:, :8].copy().view("<f4")
    return found


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
