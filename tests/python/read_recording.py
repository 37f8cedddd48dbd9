"""Reads recordings with the official MCAP library, checksums validated and warnings as errors, and prints them as JSON.

usage: read_recording.py [--frames-only] FILE...
"""

import hashlib
import json
import sys
import warnings

import numpy
from google.protobuf.json_format import MessageToDict
from mcap.reader import make_reader
from mcap.stream_reader import StreamReader
from mcap_protobuf.decoder import DecoderFactory

warnings.simplefilter("error")

NUMPY_TYPES = {1: "u1", 2: "i1", 3: "<u2", 4: "<i2", 5: "<u4", 6: "<i4", 7: "<f4", 8: "<f8"}


def points(cloud):
    layout = numpy.dtype(
        {
            "names": [field.name for field in cloud.fields],
            "formats": [NUMPY_TYPES[field.type] for field in cloud.fields],
            "offsets": [field.offset for field in cloud.fields],
            "itemsize": cloud.point_stride,
        }
    )
    table = numpy.frombuffer(cloud.data, dtype=layout)
    return {name: table[name].tolist() for name in layout.names}


def content(topic, message, raw, brief):
    if brief:
        return hashlib.sha256(raw).hexdigest()
    if topic == "/particles" or topic.startswith("/colliders/"):
        pose = MessageToDict(message.pose, always_print_fields_with_no_presence=True)
        return {"frame_id": message.frame_id, "pose": pose, "points": points(message)}
    if topic == "/camera":
        return {"frame_id": message.frame_id, "format": message.format, "data": message.data.hex()}
    return MessageToDict(message, preserving_proto_field_name=True, always_print_fields_with_no_presence=True)


def nanoseconds(stamp):
    return stamp.seconds * 1_000_000_000 + stamp.nanos


def stamp(topic, message):
    if topic == "/colliders":
        return nanoseconds(message.entities[0].timestamp)
    if topic == "/tf":
        return nanoseconds(message.transforms[0].timestamp)
    if topic in ("/diagnostics", "/solver"):
        return round(message.time_s * 1e9)
    return nanoseconds(message.timestamp)


def read(path, brief):
    with open(path, "rb") as stream:
        records, times = [], [0]
        for record in StreamReader(stream, validate_crcs=True).records:
            records.append(type(record).__name__)
            if records[-1] == "Message":
                times.append(record.log_time)
    assert times == sorted(times), "log time decreases"
    with open(path, "rb") as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        header, summary = reader.get_header(), reader.get_summary()
        attachments = list(reader.iter_attachments())
        metadata = list(reader.iter_metadata())
        messages = [
            {
                "topic": channel.topic,
                "schema": schema.name,
                "log_time": message.log_time,
                "publish_time": message.publish_time,
                "stamp": stamp(channel.topic, decoded),
                "sequence": message.sequence,
                "content": content(channel.topic, decoded, message.data, brief),
            }
            for schema, channel, message, decoded in reader.iter_decoded_messages()
        ]
    statistics = summary.statistics
    assert statistics.message_count == len(messages) == records.count("Message")
    assert statistics.chunk_count == len(summary.chunk_indexes)
    assert statistics.attachment_count == len(attachments) == len(summary.attachment_indexes)
    assert statistics.metadata_count == len(metadata) == len(summary.metadata_indexes)
    assert statistics.channel_count == len(summary.channels)
    for channel in summary.channels.values():
        counted = sum(message["topic"] == channel.topic for message in messages)
        assert statistics.channel_message_counts.get(channel.id, 0) == counted
    if messages:
        times = [message["log_time"] for message in messages]
        assert (statistics.message_start_time, statistics.message_end_time) == (min(times), max(times))
    return {
        "library": header.library,
        "attachments": {attachment.name: attachment.data.decode() for attachment in attachments},
        "metadata": {record.name: record.metadata for record in metadata},
        "topics": sorted(channel.topic for channel in summary.channels.values()),
        "chunks": [
            [chunk.compression, chunk.uncompressed_size, sorted(summary.channels[id].topic for id in chunk.message_index_offsets)]
            for chunk in summary.chunk_indexes
        ],
        "messages": messages,
    }


def digest(recording):
    """Frames, and a hash of all messages frame by frame."""
    frames = {}
    for message in recording["messages"]:
        frames.setdefault(message["log_time"], []).append(json.dumps(message, sort_keys=True))
    complete = [m for m in recording["messages"] if m["topic"] == "/diagnostics"]
    return {
        "frames": len(complete),
        "hashes": [hashlib.sha256("\n".join(frames[t]).encode()).hexdigest() for t in sorted(frames)],
        "topics": recording["topics"],
    }


if __name__ == "__main__":
    paths = sys.argv[1:]
    brief = paths[:1] == ["--frames-only"]
    for path in paths[1 if brief else 0 :]:
        recording = read(path, brief)
        print(json.dumps(digest(recording) if brief else recording))
