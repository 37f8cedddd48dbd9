// Watches a job live with Foxglove's own client, and compares what came with the recording.
//   node live.mjs SERVER JOB    prints "open" once it is connected

import assert from "node:assert/strict";

import protocol from "@foxglove/ws-protocol";
import WebSocket from "ws";

import { open } from "./recording.mjs";

const { FoxgloveClient } = protocol;

const [server, job] = process.argv.slice(2);
const address = `${server.replace("http", "ws")}${job}/live`;
const client = new FoxgloveClient({ ws: new WebSocket(address, [FoxgloveClient.SUPPORTED_SUBPROTOCOL]) });

const channels = new Map();
const topics = new Map();
const received = [];
const statuses = [];
let clock = -1n;
const subscribe = (channel) => topics.set(client.subscribe(channel.id), channel.topic);

const closed = new Promise((resolve, reject) => {
  client.on("error", reject);
  client.on("open", () => console.log("open"));
  client.on("serverInfo", (info) => assert.deepEqual(info.capabilities, ["time"]));
  client.on("status", (status) => statuses.push(status));
  client.on("advertise", (advertised) => {
    for (const channel of advertised) {
      channels.set(channel.topic, channel);
      if (channel.topic !== "/camera") subscribe(channel);
    }
  });
  client.on("time", ({ timestamp }) => {
    assert.ok(timestamp > clock, "time goes on");
    clock = timestamp;
  });
  client.on("message", ({ subscriptionId, timestamp, data }) => {
    const topic = topics.get(subscriptionId);
    assert.ok(topic === "/camera" ? timestamp <= clock : timestamp === clock);
    received.push({ topic, timestamp, data: Buffer.from(data.buffer, data.byteOffset, data.byteLength) });
    // Late, but from the first picture on.
    if (topic === "/particles" && received.filter((message) => message.topic === topic).length === 5) {
      subscribe(channels.get("/camera"));
    }
  });
  client.on("close", resolve);
});

const { code, reason } = await closed;
assert.deepEqual([code, reason], [1000, "the job has ended"]);
assert.deepEqual(statuses.map((status) => status.message), ["the job has ended"]);

const answer = await fetch(`${server}${job}/recording.mcap`);
assert.equal(answer.status, 200);
const reader = await open(new Uint8Array(await answer.arrayBuffer()));
for (const channel of reader.channelsById.values()) {
  const schema = reader.schemasById.get(channel.schemaId);
  const advertised = channels.get(channel.topic);
  assert.deepEqual(
    [advertised.encoding, advertised.schemaName, advertised.schemaEncoding],
    [channel.messageEncoding, schema.name, schema.encoding],
  );
  assert.ok(Buffer.from(schema.data).equals(Buffer.from(advertised.schema, "base64")));
}
// By topic to the byte, and all but the late one in the order of the file.
const recorded = [];
for await (const { channelId, logTime, data } of reader.readMessages()) {
  recorded.push({ topic: reader.channelsById.get(channelId).topic, timestamp: logTime, data: Buffer.from(data) });
}
const late = ({ topic }) => topic === "/camera";
for (const of of [late, (message) => !late(message)]) {
  const [got, expected] = [received.filter(of), recorded.filter(of)];
  assert.equal(got.length, expected.length);
  got.forEach((message, n) => {
    assert.deepEqual([message.topic, message.timestamp], [expected[n].topic, expected[n].timestamp], `message ${n}`);
    assert.ok(message.data.equals(expected[n].data), `bytes of message ${n} of ${message.topic}`);
  });
}
console.log(JSON.stringify({ messages: received.length, frames: received.filter(late).length }));
