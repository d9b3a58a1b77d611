// Foxglove's live WebSocket as its own JavaScript client reads it (npm's `@foxglove/ws-protocol`), with the schemas that the
// server sends; and whether such a client can start the torque.
//
// Run by `cargo xtask nightly foxglove` with host-sim's path, built with `--features foxglove`; everything is on loopback.

const assert = require("node:assert");
const { spawn } = require("node:child_process");
const { once } = require("node:events");
const readline = require("node:readline");
const { FoxgloveClient } = require("@foxglove/ws-protocol");
const protobuf = require("protobufjs");
const { FileDescriptorSet } = require("protobufjs/ext/descriptor");
const WebSocket = require("ws");

// The library's own name for its protocol is older than the server's; the messages are the same.
const SUBPROTOCOL = "foxglove.sdk.v1";
const PATIENCE_MS = 20_000;
const QUIET_MS = 2_000;

const pause = (ms) => new Promise((done) => setTimeout(done, ms));

async function wait(what, holds) {
  const end = Date.now() + PATIENCE_MS;
  while (!holds()) {
    assert(Date.now() < end, `${what}: not within ${PATIENCE_MS} ms`);
    await pause(10);
  }
}

/** A virtual device with a page, and where its stream and its page are. */
async function start(program) {
  const flags = ["run", "--port", "0", "--stream", "foxglove=127.0.0.1:0"];
  const child = spawn(program, flags, { stdio: ["ignore", "pipe", "inherit"] });
  const places = {};
  readline.createInterface({ input: child.stdout }).on("line", (line) => {
    const [, name, place] = /^(\w+) (?:stream )?at (\S+)$/.exec(line) ?? [];
    if (name) places[name] = place;
  });
  try {
    await wait("where stream and page are", () => places.foxglove && places.visualizer);
  } catch (error) {
    child.kill();
    throw error;
  }
  return { child, stream: `ws://${places.foxglove}`, page: new URL("live", places.visualizer.replace("http", "ws")) };
}

/** What turns a channel's messages into objects, from the schema that came with it. */
function decoder({ encoding, schema, schemaName }) {
  if (encoding === "json") return (data) => JSON.parse(new TextDecoder().decode(data));
  const root = protobuf.Root.fromDescriptor(FileDescriptorSet.decode(Buffer.from(schema, "base64")));
  const type = root.lookupType(schemaName);
  return (data) => type.decode(new Uint8Array(data.buffer, data.byteOffset, data.byteLength));
}

/** A client that has subscribed to all there is, and everything that it has received. */
async function connect(address) {
  const client = new FoxgloveClient({ ws: new WebSocket(address, [SUBPROTOCOL]) });
  const told = { info: null, channels: new Map(), heard: {}, errors: [], refusedCalls: [], closed: false };
  const decoders = new Map();
  client.on("serverInfo", (info) => (told.info = info));
  client.on("status", (status) => told.errors.push(status.message));
  client.on("serviceCallFailure", (failure) => told.refusedCalls.push(failure.message));
  client.on("error", (error) => told.errors.push(String(error)));
  client.on("close", () => (told.closed = true));
  client.on("advertise", (channels) => {
    for (const channel of channels) {
      told.channels.set(channel.topic, channel);
      told.heard[channel.topic] = [];
      decoders.set(client.subscribe(channel.id), [channel.topic, decoder(channel)]);
    }
  });
  client.on("message", ({ subscriptionId, data }) => {
    const [topic, decode] = decoders.get(subscriptionId);
    // Each transform follows its pose; the channels are not subscribed to at the same moment.
    if (topic === "/tf" && !told.heard["/pose"]?.length) return;
    told.heard[topic].push(decode(data));
  });
  await wait("the channels", () => told.info && ["/pose", "/event", "/tf"].every((topic) => told.channels.has(topic)));
  return { client, told };
}

function checkChannels({ info, channels }) {
  assert.strictEqual(info.name, "needle");
  assert.strictEqual(channels.size, 3, [...channels.keys()].join());
  for (const [topic, name] of [["/pose", "NeedlePose"], ["/event", "NeedleEvent"]]) {
    const { encoding, schemaEncoding, schemaName } = channels.get(topic);
    assert.deepStrictEqual([encoding, schemaEncoding, schemaName], ["json", "jsonschema", name]);
  }
  const { encoding, schemaName } = channels.get("/tf");
  assert.deepStrictEqual([encoding, schemaName], ["protobuf", "foxglove.FrameTransform"]);
}

/** Every key in the schema, and every number a number. */
function checkAgainstSchema({ channels, heard }, topic) {
  const { properties } = JSON.parse(channels.get(topic).schema);
  for (const message of heard[topic]) {
    for (const [key, value] of Object.entries(message)) {
      assert(key in properties, `${topic} holds ${key} beside its schema`);
      if (properties[key].type === "number") assert.strictEqual(typeof value, "number", `${topic} ${key}`);
    }
  }
}

async function checkPoses(told) {
  const { "/pose": poses, "/tf": transforms } = told.heard;
  const moves = () => new Set(poses.map((pose) => pose.depth_mm)).size >= 50;
  await wait("poses that change", () => poses.length >= 200 && transforms.length >= 200 && moves());
  checkAgainstSchema(told, "/pose");
  const [pose] = poses;
  assert.deepStrictEqual(Object.keys(pose).sort(), Object.keys(JSON.parse(told.channels.get("/pose").schema).properties).sort());
  poses.reduce((before, pose) => (assert(pose.t_s >= before.t_s, "times go backwards"), pose));
  for (const { tip_mm, depth_mm } of poses) assert(Math.abs(Math.hypot(...tip_mm) - Math.abs(depth_mm)) < 1e-6);
  for (const { parentFrameId, childFrameId, translation: { x, y, z }, rotation: { x: i, y: j, z: k, w } } of transforms) {
    assert.deepStrictEqual([parentFrameId, childFrameId], ["skin", "needle"]);
    assert(Math.abs(Math.hypot(i, j, k, w) - 1) < 1e-9, "not a rotation");
    const isAt = (tip) => Math.hypot(tip[0] - 1000 * x, tip[1] - 1000 * y, tip[2] - 1000 * z) < 1e-6;
    assert(poses.some((pose) => isAt(pose.tip_mm)), "/tf is at no pose's tip");
  }
  console.log(`foxglove: pass (${poses.length} poses, ${transforms.length} transforms)`);
}

/** All that the protocol lets a client send, while a person has stopped the device. */
async function checkNoOrders(client, told, page) {
  const { "/pose": poses, "/event": events } = told.heard;
  const happened = (kind) => events.filter((event) => event.kind === kind).length;
  const newest = () => poses.at(-1);
  await wait("torque from the start", () => poses.some((pose) => pose.motor_n !== 0));
  page.send(JSON.stringify({ do: "stop" }));
  await wait("the stop", () => happened("stopped") === 1 && newest().state === "idle" && newest().motor_n === 0);

  const from = poses.length;
  const order = new TextEncoder().encode(JSON.stringify({ do: "start" }));
  for (const topic of ["/control", "/event", "/pose"]) {
    const id = client.advertise({ topic, encoding: "json", schemaName: "", schema: "" });
    client.sendMessage(id, order);
  }
  for (const { id } of told.channels.values()) client.sendMessage(id, order);
  client.setParameters([{ name: "start", value: true }], "order");
  for (const serviceId of [0, 1]) client.sendServiceCallRequest({ serviceId, callId: 1, encoding: "json", data: new DataView(order.buffer) });
  client.fetchAsset("package://start", 1);
  await wait("refusals", () => told.refusedCalls.length === 2 && told.errors.length >= 5);
  await pause(QUIET_MS);

  assert(!told.closed, "the client was thrown out");
  for (const capability of ["clientPublish", "parameters", "assets"]) {
    assert(told.errors.some((error) => error.includes(capability)), `${capability}: ${told.errors.join("; ")}`);
  }
  const since = poses.slice(from);
  assert(since.length > 100, `${since.length} poses meanwhile`);
  assert(since.every((pose) => pose.motor_n === 0 && pose.state === "idle"), "the motor moved");
  // The same from the page does start it, so that the above could have been seen. A limit comes with the start, and both are reported.
  page.send(JSON.stringify({ do: "start" }));
  await wait("the start as an event", () => happened("started") > 0);
  await wait("torque after a start from the page", () => newest().state !== "idle" && newest().motor_n !== 0);
  checkAgainstSchema(told, "/event");
  console.log(`foxglove orders: pass (${told.errors.length + told.refusedCalls.length} refused, ${since.length} poses without torque)`);
}

async function main(program) {
  const { child, stream, page: pageAddress } = await start(program);
  try {
    const { client, told } = await connect(stream);
    checkChannels(told);
    await checkPoses(told);
    const page = new WebSocket(pageAddress);
    await once(page, "open");
    await checkNoOrders(client, told, page);
    page.close();
    client.close();
  } finally {
    child.kill();
  }
}

main(process.argv[2]).catch((error) => {
  console.error(error);
  process.exitCode = 1;
});
