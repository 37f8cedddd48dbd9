// Every topic of a layout is in a recording, and every field in its messages.
//   node layout.mjs LAYOUT RECORDING

import assert from "node:assert/strict";
import { readFile } from "node:fs/promises";

import protobuf from "protobufjs";

import { messages, openFile, typeOf } from "./recording.mjs";

const layout = JSON.parse(await readFile(process.argv[2], "utf8"));
const reader = await openFile(process.argv[3]);
const channels = new Map([...reader.channelsById.values()].map((channel) => [channel.topic, channel]));
const typeOfTopic = (topic) => {
  assert.ok(channels.has(topic), `there is no topic ${topic}`);
  return typeOf(reader.schemasById.get(channels.get(topic).schemaId));
};

/** A message path, such as /diagnostics.reactions[:]{name=="floor"}.force_z, leads to a number or a flag. */
function check(path) {
  const [topic, ...names] = path.replace(/\[[^\]]*\]|\{[^}]*\}/g, "").split(".");
  let type = typeOfTopic(topic);
  names.forEach((name, n) => {
    const field = type.fields[name];
    assert.ok(field, `${path}: ${type.name} has no ${name}`);
    field.resolve();
    if (n + 1 < names.length) type = field.resolvedType;
    else assert.ok(["double", "uint64", "bool"].includes(field.type), `${path} is a ${field.type}`);
  });
}

const panels = Object.entries(layout.configById);
const checked = { topics: 0, paths: 0 };
for (const [id, config] of panels) {
  const kind = id.split("!")[0];
  const topics = { "3D": Object.keys(config.topics ?? {}), Image: [config.imageMode?.imageTopic], RosOut: [config.topicToRender] };
  for (const topic of topics[kind] ?? []) {
    typeOfTopic(topic);
    checked.topics++;
  }
  for (const path of config.paths ?? []) {
    check(path.value);
    checked.paths++;
  }
  const { colorField } = config.topics?.["/particles"] ?? {};
  if (colorField) {
    for await (const { content } of messages(reader, { topics: ["/particles"] })) {
      assert.ok(content.fields.some((field) => field.name === colorField), `points have no ${colorField}`);
    }
  }
}
// Each panel has its place, and each place its panel.
const places = (node) => (typeof node === "string" ? [node] : [...places(node.first), ...places(node.second)]);
assert.deepEqual(places(layout.layout).sort(), panels.map(([id]) => id).sort());
assert.ok(checked.topics >= 4 && checked.paths >= 6);
console.log(JSON.stringify(checked));
