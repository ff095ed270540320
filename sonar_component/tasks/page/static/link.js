// The connection to the viewer task: text messages are JSON, binary ones an image (see stream.py for the layout).

const KINDS = { "<f8": Float64Array, "<f4": Float32Array, "<i4": Int32Array, "|u1": Uint8Array };
const RETRY = 1000; // [ms]

export function unpack(buffer) {
  const length = new DataView(buffer).getUint32(0, true);
  const header = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
  let at = 4 + length;
  for (const [name, dtype, shape] of header.arrays) {
    const count = shape.reduce((a, b) => a * b, 1);
    const Kind = KINDS[dtype];
    header[name] = new Kind(buffer, at, count);
    header[name + "_shape"] = shape;
    at += Math.ceil((count * Kind.BYTES_PER_ELEMENT) / 8) * 8;
  }
  return header;
}

export class Link {
  constructor(hear, changed) {
    this.hear = hear;
    this.changed = changed;
    this.open();
    document.addEventListener("visibilitychange", () => this.say({ kind: "visible", visible: !document.hidden }));
  }

  open() {
    this.socket = new WebSocket(location.origin.replace(/^http/, "ws") + "/live");
    this.socket.binaryType = "arraybuffer";
    this.socket.onopen = () => {
      this.changed(true);
      if (document.hidden) this.say({ kind: "visible", visible: false });
    };
    this.socket.onmessage = (event) => {
      this.hear(typeof event.data === "string" ? JSON.parse(event.data) : unpack(event.data));
    };
    this.socket.onclose = () => {
      this.changed(false);
      setTimeout(() => this.open(), RETRY);
    };
  }

  say(message) {
    if (this.socket.readyState === WebSocket.OPEN) this.socket.send(JSON.stringify(message));
  }
}
