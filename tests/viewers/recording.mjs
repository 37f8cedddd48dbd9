// Recordings as viewers on the web open them: with @mcap/core, through the schemas in the file.

import { readFile } from "node:fs/promises";

import zstd from "@foxglove/wasm-zstd";
import { McapIndexedReader } from "@mcap/core";
import protobuf from "protobufjs";
import descriptor from "protobufjs/ext/descriptor/index.js";

/** A reader of bytes. */
export async function open(bytes) {
  await zstd.isLoaded;
  return McapIndexedReader.Initialize({
    readable: {
      size: async () => BigInt(bytes.byteLength),
      read: async (offset, length) => bytes.subarray(Number(offset), Number(offset + length)),
    },
    decompressHandlers: { zstd: (data, size) => zstd.decompress(data, Number(size)) },
  });
}

export async function openFile(path) {
  return open(new Uint8Array(await readFile(path)));
}

/** The type of a schema's messages, made of its descriptors. */
export function typeOf(schema) {
  const root = protobuf.Root.fromDescriptor(descriptor.FileDescriptorSet.decode(schema.data));
  root.resolveAll();
  return root.lookupType(schema.name);
}

/** All messages with their topics, by log time. */
export async function* messages(reader, options = {}) {
  const types = new Map();
  for await (const message of reader.readMessages(options)) {
    const channel = reader.channelsById.get(message.channelId);
    if (!types.has(channel.id)) types.set(channel.id, typeOf(reader.schemasById.get(channel.schemaId)));
    yield { ...message, topic: channel.topic, content: types.get(channel.id).decode(message.data) };
  }
}

/** Topics of each chunk. */
export function topicsByChunk(reader) {
  return reader.chunkIndexes.map((chunk) =>
    [...chunk.messageIndexOffsets.keys()].map((id) => reader.channelsById.get(id).topic),
  );
}
