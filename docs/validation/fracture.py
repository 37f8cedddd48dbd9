#!/usr/bin/env python3
"""How whole a body stays: the share of particles in the largest connected piece of each frame, from recordings.

    for k in compact quadratic; do gridfall run scenes/NAME.json --set solver.kernel=$k -o NAME-$k.mcap; done
    python3 docs/validation/fracture.py DX docs/validation/NAME.png NAME-compact.mcap NAME-quadratic.mcap

Particles are connected when they are in the same or in neighbouring cells of DX (m). Needs mcap, mcap-protobuf-support, numpy, matplotlib.
"""

import pathlib
import sys

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt
import numpy as np
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory


def frames(path):
    """Time (s) and positions (n, 3) of every frame."""
    with open(path, "rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        for _, _, message, cloud in reader.iter_decoded_messages(topics=["/particles"]):
            data = np.frombuffer(cloud.data, dtype=np.uint8).reshape(-1, cloud.point_stride)
            corner = cloud.pose.position
            yield message.log_time * 1e-9, data[:, :12].copy().view(np.float32) + [corner.x, corner.y, corner.z]


def largest_share(x, dx):
    """Share of the points in the largest set of face-, edge- or corner-connected cells."""
    cells = np.floor(x / dx).astype(int)
    counts = {}
    for cell in map(tuple, cells):
        counts[cell] = counts.get(cell, 0) + 1
    near = [(i, j, k) for i in (-1, 0, 1) for j in (-1, 0, 1) for k in (-1, 0, 1)]
    best, seen = 0, set()
    for start in counts:
        if start in seen:
            continue
        seen.add(start)
        piece, open_cells = 0, [start]
        while open_cells:
            cell = open_cells.pop()
            piece += counts[cell]
            for d in near:
                other = (cell[0] + d[0], cell[1] + d[1], cell[2] + d[2])
                if other in counts and other not in seen:
                    seen.add(other)
                    open_cells.append(other)
        best = max(best, piece)
    return best / len(x)


def main():
    dx, out, recordings = float(sys.argv[1]), sys.argv[2], sys.argv[3:]
    figure, axes = plt.subplots(figsize=(6.4, 3.4))
    for path in recordings:
        curve = [(t, largest_share(x, dx), len(np.unique(np.floor(x / dx).astype(int), axis=0))) for t, x in frames(path)]
        time, share, cells = map(np.array, zip(*curve))
        name = pathlib.Path(path).stem
        axes.plot(time, cells / cells[0], label=f"{name}: cells with particles")
        axes.plot(time, share, "--", label=f"{name}: largest piece")
        print(f"{name}: at the end {cells[-1] / cells[0]:.3f} of the cells at the start, largest piece {share[-1]:.3f} of the particles")
    axes.set_xlabel("time (s)")
    axes.grid(alpha=0.3)
    axes.legend(fontsize=7)
    figure.tight_layout()
    figure.savefig(out, dpi=100)


if __name__ == "__main__":
    main()
