// Reads a sonar port from another language: ZeroMQ and msgpack, no code of this project.
// The format is written down in sonar_component/middleware/README.md.
//
//   npm install --prefix tools
//   sonar inspect fls --json          the endpoint of each port
//   node tools/read_sonar.mjs ipc:///run/user/1000/sonar/demo/fls.sonar_samples fls.sonar_samples 3

import { decode } from "@msgpack/msgpack";
import { Subscriber } from "zeromq";

const [endpoint, port, count = "1"] = process.argv.slice(2);
if (!port) {
  console.error("usage: node read_sonar.mjs ENDPOINT TASK.PORT [COUNT]");
  process.exit(2);
}

const VIEWS = {
  "|b1": Uint8Array, "|u1": Uint8Array, "|i1": Int8Array, "<u2": Uint16Array, "<i2": Int16Array,
  "<u4": Uint32Array, "<i4": Int32Array, "<u8": BigUint64Array, "<i8": BigInt64Array,
  "<f4": Float32Array, "<f8": Float64Array,
};

function readSample(frames) {
  const header = decode(frames[1], { useBigInt64: false });
  const sample = { ...header.body };
  let next = 2;
  for (const [name, dtype, shape, inline] of header.arr) {
    const bytes = inline ?? frames[next++];
    const copy = bytes.buffer.slice(bytes.byteOffset, bytes.byteOffset + bytes.byteLength); // aligned
    sample[name] = { shape, values: new VIEWS[dtype](copy) };
  }
  return { header, sample };
}

const socket = new Subscriber();
socket.connect(endpoint);
socket.subscribe(port + "\0"); // the NUL keeps "fls.sonar" from matching "fls.sonar_samples"
socket.subscribe("@" + process.pid + Date.now()); // any name of our own: the last sample comes under it at once

let seen = 0;
for await (const frames of socket) {
  const { header, sample } = readSample(frames);
  const { shape, values } = sample.bins;
  console.log(JSON.stringify({
    source: header.src, seq: header.seq, time: header.t, type: header.type, shape,
    sum: values.reduce((sum, value) => sum + value, 0),
    left: sample.bearings.values[0], speed_of_sound: sample.speed_of_sound,
  }));
  if (++seen >= Number(count)) break;
}
socket.close();
