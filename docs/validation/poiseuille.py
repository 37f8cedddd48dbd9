#!/usr/bin/env python3
"""The picture of the flow between sticky walls in docs/NUMERICS.md, from recordings of one scene in the plane.

    python3 docs/validation/poiseuille.py docs/validation/poiseuille.png LABEL=RECORDING.mcap ...

The scene: a channel of 0.2 m, 16 cells across, 1000 kg/m3, 10 Pa s, driven by 1 m/s2, K = 2e5 Pa; its last frame is
drawn. Needs matplotlib, numpy, mcap and mcap-protobuf-support.
"""

import sys

import matplotlib
import numpy

matplotlib.use("Agg")
import matplotlib.pyplot as plt
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

HEIGHT, DENSITY, VISCOSITY, DRIVE = 0.2, 1e3, 10.0, 1.0


def last_frame(path):
    """Time (s), heights (m) and speeds (m/s) of the particles."""
    with open(path, "rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        *_, (_, _, message, points) = reader.iter_decoded_messages(topics=["/particles"])
    offsets = {field.name: field.offset for field in points.fields}
    data = numpy.frombuffer(points.data, numpy.uint8).reshape(-1, points.point_stride)
    column = lambda name: data[:, offsets[name] : offsets[name] + 4].copy().view("<f4")[:, 0]
    return message.log_time * 1e-9, column("y") + points.pose.position.y, column("vx")


def exact(y, time):
    k = numpy.arange(1, 80, 2)[:, None]
    scale = DENSITY * DRIVE / VISCOSITY
    decay = numpy.exp(-((k * numpy.pi / HEIGHT) ** 2) * VISCOSITY / DENSITY * time)
    early = 4 * scale * HEIGHT**2 / (k * numpy.pi) ** 3 * numpy.sin(k * numpy.pi * y / HEIGHT) * decay
    return 0.5 * scale * y * (HEIGHT - y) - early.sum(0)


def main():
    plot, axes = plt.subplots(figsize=(6.4, 4), dpi=100)
    for argument in sys.argv[2:]:
        label, path = argument.split("=", 1)
        time, y, speed = last_frame(path)
        axes.plot(speed, y, "o", markersize=2, label=label)
    y = numpy.linspace(0, HEIGHT, 200)
    axes.plot(exact(y, time), y, "k--", linewidth=1.2, label="closed form")
    axes.set(title="Flow between sticky walls, 16 cells across", xlabel="speed (m/s)", ylabel="height (m)")
    axes.grid(alpha=0.3)
    axes.legend(fontsize=8)
    plot.tight_layout()
    plot.savefig(sys.argv[1])


if __name__ == "__main__":
    main()
