"""Frames are what was computed, wherever the scene lies and however they are laid out."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory

import gridfall
from gridfall.recording import frame_of


def test_frames_agree_with_the_diagnostics(ran: gridfall.Result) -> None:
    frames, rows = ran.frames, ran.diagnostics
    assert len(frames) == len(rows) == 6
    assert frames.times == pytest.approx(rows["time_s"])
    assert frames.times == pytest.approx(np.arange(6) / 100)
    for frame, row in zip(frames, rows, strict=True):
        assert frame.velocity is not None and frame.colors is not None
        assert len(frame) == ran.job.particles == len(frame["J"]) == len(frame.colors)
        # All particles have the same mass, so means are those of the body.
        assert frame.positions[:, 2].mean() == pytest.approx(row["gravity_j"] / (row["mass_kg"] * 10), rel=1e-6)
        momentum = [row[f"momentum_{axis}"] for axis in "xyz"]
        assert frame.velocity.mean(axis=0) == pytest.approx(np.array(momentum) / row["mass_kg"], abs=1e-5)
        speeds = np.linalg.norm(frame.velocity, axis=1)
        assert speeds.max() == pytest.approx(row["max_speed"], rel=1e-5)
        assert frame["J"].min() == pytest.approx(row["min_J"], rel=1e-5)


def test_positions_are_in_the_coordinates_of_the_scene(ran: gridfall.Result) -> None:
    first, last = ran.frames[0].positions, ran.frames[-1].positions
    assert first.dtype == np.float64 and first.shape[1] == 3
    assert first.min(axis=0) == pytest.approx([10.25, -4.75, 2.35], abs=0.07)
    assert first.max(axis=0) == pytest.approx([10.75, -4.25, 2.85], abs=0.07)
    moved = last.mean(axis=0) - first.mean(axis=0)
    assert moved == pytest.approx([0.5 * 0.05, 0, -0.5 * 10 * 0.05**2], abs=1e-5)


def test_frames_are_a_sequence(ran: gridfall.Result) -> None:
    frames = ran.frames
    assert [frame.index for frame in frames] == [0, 1, 2, 3, 4, 5]
    assert frames[-1].index == 5 and [frame.index for frame in frames[::2]] == [0, 2, 4]
    assert [frame.index for frame in reversed(frames)] == [5, 4, 3, 2, 1, 0]
    with pytest.raises(IndexError, match="has 6, from 0"):
        frames[6]


def test_one_frame_is_read_without_the_others(ran: gridfall.Result, tmp_path: Path) -> None:
    damaged = ran.recording.save(tmp_path / "damaged.mcap")
    with damaged.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    chunks = sorted(summary.chunk_indexes, key=lambda chunk: chunk.message_start_time)
    assert len(chunks) >= 6
    with damaged.open("r+b") as stream:
        for chunk in chunks:
            if chunk.message_start_time != 30_000_000:
                stream.seek(chunk.chunk_start_offset + 50)
                stream.write(bytes(chunk.chunk_length - 50))
    with gridfall.Recording(damaged) as recording:
        assert np.array_equal(recording.frames[3].positions, ran.frames[3].positions)
        with pytest.raises(gridfall.RecordingError, match="frame 2 of .* is damaged"):
            recording.frames[2]


def test_fields_and_pose_are_read_as_declared(ran: gridfall.Result) -> None:
    with ran.recording.path.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        *_, recorded = next(reader.iter_decoded_messages(topics=["/particles"]))
    cloud = type(recorded)()
    layout = [("J", 7, 0), ("y", 8, 4), ("x", 8, 12), ("z", 8, 24), ("vx", 7, 32), ("vy", 4, 36), ("vz", 2, 38)]
    for name, kind, offset in layout:
        cloud.fields.add(name=name, type=kind, offset=offset)
    cloud.point_stride = 39
    kinds = {"J": "<f4", "y": "<f8", "x": "<f8", "z": "<f8", "vx": "<f4", "vy": "<i2", "vz": "i1"}
    offsets = [offset for _, _, offset in layout]
    dtype: Any = np.dtype({"names": list(kinds), "formats": list(kinds.values()), "offsets": offsets, "itemsize": 39})
    points = np.zeros(2, dtype)
    for name, values in {"x": [1, 4], "y": [2, 5], "z": [3, 6], "J": [0.5, 1], "vx": [3, 0], "vy": [-4, 0]}.items():
        points[name] = values
    cloud.data = points.tobytes()
    cloud.pose.position.x, cloud.pose.position.y, cloud.pose.position.z = 100, 200, 300
    cloud.pose.orientation.z = cloud.pose.orientation.w = np.sqrt(0.5)
    frame = frame_of(cloud, 7, 500_000_000)
    # A quarter turn about z.
    assert frame.positions == pytest.approx(np.array([[98, 201, 303], [95, 204, 306]]))
    assert frame.velocity == pytest.approx(np.array([[4, 3, 0], [0, 0, 0]]))
    assert (frame.index, frame.time, list(frame.fields)) == (7, 0.5, ["J"])
    assert frame["J"].tolist() == [0.5, 1] and frame.colors is None


def test_what_a_recording_carries(ran: gridfall.Result, cube: gridfall.Scene, client: gridfall.Client) -> None:
    recorded = ran.recording.scene
    assert (recorded.name, recorded.domain.dx, recorded.bodies[0].shape) == ("cube", 0.125, cube.bodies[0].shape)
    assert ran.recording.metadata["run"]["name"] == "cube"
    ours, servers = ran.diagnostics, client.diagnostics(ran.job)
    assert set(ours.dtype.names or ()) == set(servers.dtype.names or ())
    for name in ours.dtype.names or ():
        assert np.array_equal(ours[name], servers[name]), name
    assert len(ran.solver) == len(client.solver(ran.job)) == 0


def test_files_that_are_no_recordings(ran: gridfall.Result, tmp_path: Path) -> None:
    whole = ran.recording.path.read_bytes()
    for number, content in enumerate([b"", b"not a recording", whole[: len(whole) // 2]]):
        file = tmp_path / str(number)
        file.write_bytes(content)
        with pytest.raises(gridfall.RecordingError, match="is not a whole MCAP file"):
            gridfall.Recording(file)


def test_temporary_files_go_with_the_recording(client: gridfall.Client, ran: gridfall.Result, tmp_path: Path) -> None:
    recording = client.recording(ran.job)
    folder = recording.path.parent
    assert recording.save(tmp_path / "kept.mcap").stat().st_size == recording.path.stat().st_size
    recording.close()
    assert not folder.exists()
