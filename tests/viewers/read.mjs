// Reads a recording of scene.json as viewers on the web do, and compares its schemas with those that Foxglove publishes.
//   node read.mjs RECORDING POINTS

import assert from "node:assert/strict";

import { foxgloveEnumSchemas, foxgloveMessageSchemas, generateProto } from "@foxglove/schemas/internal.js";
import protobuf from "protobufjs";

import { messages, openFile, topicsByChunk, typeOf } from "./recording.mjs";

const [path, points] = [process.argv[2], Number(process.argv[3])];
const CORNER = [500000, 5000000, 100];
const FRAMES = 6;
const FRAME_NS = 20_000_000n;

const published = new protobuf.Root();
for (const file of ["timestamp", "duration"]) {
  published.addJSON(protobuf.common.get(`google/protobuf/${file}.proto`).nested);
}
for (const schema of Object.values(foxgloveMessageSchemas)) {
  const enums = Object.values(foxgloveEnumSchemas).filter((e) => e.parentSchemaName === schema.name);
  protobuf.parse(generateProto(schema, enums), published, { keepCase: true });
}
published.resolveAll();

/** What a message is on the wire, with all that it holds. */
function form(type, seen = new Set()) {
  const name = type.fullName.replace(/^\./, "");
  if (seen.has(name)) return name;
  seen.add(name);
  const fields = type.fieldsArray.map((field) => {
    field.resolve();
    const inner = field.resolvedType instanceof protobuf.Type ? form(field.resolvedType, seen) : null;
    const values = field.resolvedType instanceof protobuf.Enum ? field.resolvedType.values : null;
    return { name: field.name, id: field.id, repeated: field.repeated, type: inner ?? values ?? field.type };
  });
  return JSON.parse(JSON.stringify({ name, fields: fields.sort((a, b) => a.id - b.id) }));
}

const nanos = ({ seconds, nanos }) => BigInt(seconds.toString()) * 1_000_000_000n + BigInt(nanos);
const vector = ({ x, y, z }) => [x, y, z];

const reader = await openFile(path);
for (const schema of reader.schemasById.values()) {
  if (!schema.name.startsWith("foxglove.")) continue;
  assert.deepEqual(form(typeOf(schema)), form(published.lookupType(schema.name)), schema.name);
}

for (const topics of topicsByChunk(reader)) {
  for (const kind of ["/particles", "/camera", "/colliders"]) {
    const some = topics.some((topic) => topic.startsWith(kind));
    assert.ok(!some || topics.every((topic) => topic.startsWith(kind)), `${topics}`);
  }
}

const counts = {};
let last = 0n;
for await (const { topic, logTime, publishTime, content } of messages(reader)) {
  const nth = (counts[topic] = (counts[topic] ?? 0) + 1) - 1;
  assert.ok(logTime >= last && publishTime === logTime, topic);
  last = logTime;
  if (topic === "/particles") {
    assert.equal(logTime, BigInt(nth) * FRAME_NS);
    assert.equal(nanos(content.timestamp), logTime);
    assert.equal(content.frame_id, "world");
    assert.deepEqual(vector(content.pose.position), CORNER);
    assert.deepEqual({ ...content.pose.orientation.toJSON() }, { w: 1 });
    const names = content.fields.map((field) => field.name);
    assert.deepEqual(names, ["x", "y", "z", "vx", "vy", "vz", "J", "von_mises", "red", "green", "blue", "alpha"]);
    assert.equal(content.data.length, points * content.point_stride);
    const view = new DataView(content.data.buffer, content.data.byteOffset, content.data.byteLength);
    const seen = new Set();
    for (let p = 0; p < points; p++) {
      const x = [0, 4, 8].map((offset) => view.getFloat32(p * content.point_stride + offset, true));
      // The block falls for a tenth of a second.
      assert.ok(x[0] > 0.25 && x[0] < 0.75 && x[1] > 0.25 && x[1] < 0.75 && x[2] > 0.3 && x[2] < 0.85, `${x}`);
      seen.add(`${x}`);
    }
    assert.equal(seen.size, points, "no two particles are at one place");
  } else if (topic === "/colliders") {
    assert.deepEqual(content.entities.map((entity) => entity.id), ["domain", "paddle", "ring"]);
    const [domain, paddle, ring] = content.entities;
    assert.deepEqual(vector(domain.lines[0].pose.position), CORNER);
    assert.equal(domain.lines[0].points.length, 24);
    assert.equal(paddle.frame_id, "colliders/paddle");
    vector(paddle.cubes[0].pose.position).forEach((x, a) => assert.ok(Math.abs(x - CORNER[a] - [0.5, 0.5, 0.15][a]) < 1e-8));
    assert.deepEqual(vector(ring.triangles[0].pose.position), CORNER);
    for (const point of ring.triangles[0].points) {
      assert.ok(Math.abs(Math.hypot(Math.hypot(point.x - 0.5, point.y - 0.5) - 0.3, point.z - 0.3) - 0.05) < 0.01);
    }
  } else if (topic === "/colliders/ring") {
    assert.equal(content.frame_id, "world");
    assert.deepEqual(vector(content.pose.position), CORNER);
    assert.ok(content.data.length > 100 * content.point_stride);
  } else if (topic === "/colliders/paddle") {
    assert.equal(content.frame_id, "colliders/paddle");
  } else if (topic === "/tf") {
    const [world, paddle] = content.transforms;
    assert.deepEqual([world.parent_frame_id, world.child_frame_id], ["tf#/", "world"]);
    assert.deepEqual(vector(world.translation), CORNER.map((x) => -x));
    assert.equal(paddle.child_frame_id, "colliders/paddle");
    const angle = (0.5 * Number(logTime)) / 1e9;
    assert.ok(Math.abs(paddle.rotation.z - Math.sin(angle / 2)) < 1e-12);
  } else if (topic === "/camera") {
    assert.deepEqual([...content.data.slice(1, 4)], [..."PNG"].map((c) => c.charCodeAt(0)));
  } else if (topic === "/diagnostics") {
    assert.equal(Math.round(content.time_s * 1e9), Number(logTime));
  }
}
assert.ok(counts["/solver"] >= FRAMES - 1 && counts["/log"] >= 2);
for (const topic of ["/particles", "/camera", "/tf", "/diagnostics"]) assert.equal(counts[topic], FRAMES, topic);
for (const topic of ["/colliders", "/colliders/paddle", "/colliders/ring"]) assert.equal(counts[topic], 1, topic);
console.log(JSON.stringify(counts));
