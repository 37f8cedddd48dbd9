"""Recordings: frames as NumPy arrays, diagnostics, the scene."""

from __future__ import annotations

import json
import os
import shutil
import weakref
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from functools import cached_property
from io import BytesIO
from itertools import islice
from pathlib import Path
from typing import Any, overload

import numpy as np
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.reader import SeekingReader
from mcap.records import Channel, Chunk, Message, MessageIndex, Schema
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap_protobuf.decoder import DecoderFactory
from numpy.typing import NDArray

from .errors import RecordingError
from .scene import Scene
from .tables import table

PARTICLES = "/particles"
# foxglove.NumericType
_TYPES = {1: "u1", 2: "i1", 3: "<u2", 4: "<i2", 5: "<u4", 6: "<i4", 7: "<f4", 8: "<f8"}
_WALLS = [f"wall_{axis}{side}" for axis in "xyz" for side in "-+"]
_COLOR = ("red", "green", "blue", "alpha")


@dataclass(frozen=True, eq=False)
class Frame:
    """The recorded points of a frame."""

    index: int
    """Number of the frame; 0 is the initial state."""
    time: float
    """Simulated time (s)."""
    positions: NDArray[np.float64]
    """Positions in the scene's coordinates (m), n × 3; z is 0 in 2D."""
    velocity: NDArray[np.float64] | None
    """Velocities (m/s), n × 3, if the scene's `output.fields` has them."""
    colors: NDArray[np.uint8] | None
    """Red, green, blue and alpha as recorded, n × 4."""
    fields: dict[str, NDArray[Any]]
    """All other recorded fields by name, n values each: `J`, `von_mises`, `pressure`."""

    def __len__(self) -> int:
        return len(self.positions)

    def __getitem__(self, field: str) -> NDArray[Any]:
        return self.fields[field]

    def __repr__(self) -> str:
        return f"Frame({self.index}, time={self.time:g}, points={len(self)}, fields={list(self.fields)})"


class Frames(Sequence[Frame]):
    """The frames of a recording. Each is read when it is asked for, and nothing else of the file is."""

    def __init__(self, recording: Recording) -> None:
        self._recording = recording

    @property
    def times(self) -> NDArray[np.float64]:
        """Simulated times of the frames (s)."""
        return np.array(self._recording._times, dtype=np.float64) * 1e-9

    def __len__(self) -> int:
        return len(self._recording._times)

    @overload
    def __getitem__(self, index: int) -> Frame: ...
    @overload
    def __getitem__(self, index: slice) -> list[Frame]: ...
    def __getitem__(self, index: int | slice) -> Frame | list[Frame]:
        if isinstance(index, slice):
            return [self[each] for each in range(*index.indices(len(self)))]
        at = index + len(self) if index < 0 else index
        if not 0 <= at < len(self):
            raise IndexError(f"there is no frame {index}; the recording has {len(self)}, from 0")
        return self._recording._frame(at)

    def __iter__(self) -> Iterator[Frame]:
        return (self[index] for index in range(len(self)))


class Recording:
    """A recording: an MCAP file that a run left, or a snapshot of one that goes on."""

    def __init__(self, path: str | os.PathLike[str], *, temporary: Path | None = None) -> None:
        """Opens a file. `temporary` is a folder that is removed with the recording."""
        self.path = Path(path)
        """Where the file is."""
        self._stream = self.path.open("rb")
        self._end = weakref.finalize(self, _end, self._stream, temporary)
        try:
            self._reader = SeekingReader(self._stream, decoder_factories=[DecoderFactory()])
            summary = self._reader.get_summary()
        except (McapError, ValueError, OSError, EOFError) as error:
            self.close()
            raise RecordingError(f"{self.path} is not a whole MCAP file: {error or type(error).__name__}") from error
        if summary is None:
            self.close()
            raise RecordingError(f"{self.path} has no index; `mcap recover` gives it one")
        self._summary = summary

    def close(self) -> None:
        """Closes the file. A temporary one is removed."""
        self._end()

    def __enter__(self) -> Recording:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def __repr__(self) -> str:
        return f"Recording({str(self.path)!r}, frames={len(self.frames)})"

    def save(self, path: str | os.PathLike[str]) -> Path:
        """Copies the file, for a viewer or to be kept. Returns where it is."""
        return Path(shutil.copyfile(self.path, path))

    @property
    def frames(self) -> Frames:
        """The frames: `frames[-1]`, `len(frames)`, `for frame in frames`."""
        return Frames(self)

    @cached_property
    def scene(self) -> Scene:
        """The scene that was run."""
        return Scene.from_dict(json.loads(self._attachment("scene.json")))

    @cached_property
    def metadata(self) -> dict[str, dict[str, str]]:
        """What was run, by which build and on what: `build`, `run`, `hardware`."""
        return {record.name: dict(record.metadata) for record in self._reader.iter_metadata()}

    @cached_property
    def diagnostics(self) -> NDArray[np.void]:
        """Energies, momenta, mass and time steps, a row a frame: `diagnostics["kinetic_j"]`."""
        return table(_row(message) for message in self._messages("/diagnostics"))

    @cached_property
    def solver(self) -> NDArray[np.void]:
        """How the implicit integrator fared, a row a step; empty of explicit runs."""
        return table(_row(message) for message in self._messages("/solver"))

    def _attachment(self, name: str) -> bytes:
        for attachment in self._reader.iter_attachments():
            if attachment.name == name:
                return bytes(attachment.data)
        raise RecordingError(f"{self.path} has no {name}")

    def _messages(self, topic: str) -> Iterator[Any]:
        return (decoded for _, _, _, decoded in self._reader.iter_decoded_messages(topics=[topic]))

    @cached_property
    def _times(self) -> list[int]:
        """Times of the frames (ns), from the index."""
        channels = {id for id, channel in self._summary.channels.items() if channel.topic == PARTICLES}
        times = []
        for chunk in self._summary.chunk_indexes:
            for channel in channels & chunk.message_index_offsets.keys():
                self._stream.seek(chunk.message_index_offsets[channel])
                record = next(StreamReader(self._stream, skip_magic=True).records)
                if not isinstance(record, MessageIndex):
                    raise RecordingError(f"{self.path} has a broken index")
                times += [time for time, _ in record.records]
        return sorted(times)

    def _frame(self, index: int) -> Frame:
        time = self._times[index]
        found = self._reader.iter_decoded_messages(topics=[PARTICLES], starting_at=time, ending_at=time)
        try:
            for _, _, _, cloud in found:
                return frame_of(cloud, index, time)
        except Exception as error:  # whatever decompression and decoding make of damaged bytes
            raise RecordingError(f"frame {index} of {self.path} is damaged: {error or type(error).__name__}") from error
        raise RecordingError(f"{self.path} has no frame at {time} ns, where its index has one")


class GrowingRecording:
    """Takes a recording piece by piece as it grows, and gives the frames that are complete."""

    def __init__(self) -> None:
        self._left = b""
        self._at_magic = True
        self._ended = False
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Channel] = {}
        self._decoder = DecoderFactory()
        self._frames = 0

    def feed(self, piece: bytes) -> Iterator[Frame]:
        """The frames that are complete with this piece."""
        if self._ended:
            return
        self._left += piece
        if self._at_magic and len(self._left) >= 8:
            self._left, self._at_magic = self._left[8:], False
        while not self._at_magic and len(self._left) >= 9:
            length = 9 + int.from_bytes(self._left[1:9], "little")
            if len(self._left) < length:
                return
            record, self._left = self._left[:length], self._left[length:]
            if record[0] == Opcode.DATA_END:
                # What follows is the index.
                self._ended = True
                return
            yield from self._records(record)

    def _records(self, record: bytes) -> Iterator[Frame]:
        [outer] = islice(StreamReader(BytesIO(record), skip_magic=True, emit_chunks=True).records, 1)
        for inner in breakup_chunk(outer) if isinstance(outer, Chunk) else [outer]:
            if isinstance(inner, Schema):
                self._schemas[inner.id] = inner
            elif isinstance(inner, Channel):
                self._channels[inner.id] = inner
            elif isinstance(inner, Message) and self._channels[inner.channel_id].topic == PARTICLES:
                yield self._frame(inner)

    def _frame(self, message: Message) -> Frame:
        channel = self._channels[message.channel_id]
        decode = self._decoder.decoder_for(channel.message_encoding, self._schemas[channel.schema_id])
        if decode is None:
            raise RecordingError(f"{PARTICLES} is not in protobuf")
        self._frames += 1
        return frame_of(decode(message.data), self._frames - 1, message.log_time)


def frame_of(cloud: Any, index: int, time_ns: int) -> Frame:
    """A frame of a `foxglove.PointCloud`, by the fields and the pose that it declares."""
    layout = np.dtype(
        {
            "names": [field.name for field in cloud.fields],
            "formats": [_TYPES[field.type] for field in cloud.fields],
            "offsets": [field.offset for field in cloud.fields],
            "itemsize": cloud.point_stride,
        }
    )
    points = np.frombuffer(cloud.data, dtype=layout)
    names = [field.name for field in cloud.fields]

    def columns(wanted: Sequence[str], kind: type[np.generic]) -> NDArray[Any] | None:
        if any(name not in names for name in wanted):
            return None
        return np.stack([points[name].astype(kind) for name in wanted], axis=1)

    position = columns(("x", "y", "z"), np.float64)
    if position is None:
        raise RecordingError(f"frame {index} does not say where its points are")
    velocity, turn = columns(("vx", "vy", "vz"), np.float64), _rotation(cloud)
    if turn is not None:
        position = position @ turn.T
        velocity = velocity @ turn.T if velocity is not None else None
    if cloud.HasField("pose") and cloud.pose.HasField("position"):
        position = position + np.array([cloud.pose.position.x, cloud.pose.position.y, cloud.pose.position.z])
    taken = {"x", "y", "z", *_COLOR} | ({"vx", "vy", "vz"} if velocity is not None else set())
    others = {name: np.ascontiguousarray(points[name]) for name in names if name not in taken}
    return Frame(index, time_ns * 1e-9, position, velocity, columns(_COLOR, np.uint8), others)


def _rotation(cloud: Any) -> NDArray[np.float64] | None:
    """The rotation of the cloud's pose; None if it is none."""
    if not (cloud.HasField("pose") and cloud.pose.HasField("orientation")):
        return None
    q = cloud.pose.orientation
    x, y, z, w = q.x, q.y, q.z, q.w
    if (x, y, z) == (0.0, 0.0, 0.0):
        return None
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)],
            [2 * (x * y + z * w), 1 - 2 * (x * x + z * z), 2 * (y * z - x * w)],
            [2 * (x * z - y * w), 2 * (y * z + x * w), 1 - 2 * (x * x + y * y)],
        ]
    )


def _row(message: Any) -> dict[str, Any]:
    """The numbers of a message, those of its surfaces as `NAME.force_x` and so on. Walls have no torque."""
    row: dict[str, Any] = {}
    for field in message.DESCRIPTOR.fields:
        value = getattr(message, field.name)
        if field.name != "reactions":
            row[field.name] = value
            continue
        for each in value:
            kinds = ("force",) if each.name in _WALLS else ("force", "torque")
            names = [f"{kind}_{axis}" for kind in kinds for axis in "xyz"]
            row.update({f"{each.name}.{name}": getattr(each, name) for name in names})
    return row


def _end(stream: Any, temporary: Path | None) -> None:
    stream.close()
    if temporary is not None:
        shutil.rmtree(temporary, ignore_errors=True)
