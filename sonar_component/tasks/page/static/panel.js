// One sonar: its picture, rings and ticks, cursor, and the controls of how it is shown.

import { Image, fanTable, polarTable, sectorBox } from "./image.js";

const MAX_PIXELS = 1200; // [-] of the longer side: more is not in the image, and costs time on large screens
const BESIDES = 210; // [CSS pixels] of height that the header, the controls and the readings take
const DEGREE = Math.PI / 180;
const GRID = "rgba(255,255,255,0.35)", FAINT = "rgba(255,255,255,0.14)", LABEL = "rgba(255,255,255,0.8)";

const MARKUP = `
  <h2></h2>
  <div class="bar">
    <select class="view" title="view"><option value="fan">fan</option><option value="polar">polar, raw</option></select>
    <select class="map" title="colour map"></select>
    <select class="law" title="scale"><option value="db">dB</option><option value="linear">linear</option></select>
    <label>gain <input class="gain" type="range" min="-20" max="20" step="1" value="0"><output></output></label>
    <label>range <input class="dynamic" type="range" min="10" max="80" step="5" value="40"><output></output></label>
    <label title="brightness follows the strongest echoes"><input class="auto" type="checkbox" checked>auto</label>
    <button class="pause">pause</button><button class="step">step</button>
    <button class="png">save PNG</button><button class="raw">save raw</button>
  </div>
  <div class="stage"><canvas class="under"></canvas><canvas class="over"></canvas></div>
  <div class="scale"><span class="low"></span><canvas width="256" height="1"></canvas><span class="high"></span></div>
  <div class="cursor facts">&nbsp;</div>
  <div class="notice bad"></div>`;

export class Panel {
  constructor(source, colours, link) {
    Object.assign(this, { source, colours, link, image: new Image(), age: null, paused: false, pending: 0 });
    this.node = document.createElement("section");
    this.node.className = "panel";
    this.node.dataset.source = source;
    this.node.innerHTML = MARKUP;
    const find = (name) => this.node.querySelector(name);
    this.title = find("h2");
    this.under = find(".under");
    this.over = find(".over");
    this.stage = find(".stage");
    this.cursor = find(".cursor");
    this.notice = find(".notice");
    this.controls = Object.fromEntries(
      ["view", "map", "law", "gain", "dynamic", "auto", "pause", "step", "png", "raw"].map((n) => [n, find("." + n)]));
    for (const name of Object.keys(colours.maps)) this.controls.map.add(new Option(name, name));
    this.wire();
    new ResizeObserver(() => this.layOut()).observe(this.node);
    window.addEventListener("resize", () => this.layOut());
  }

  wire() {
    const { view, map, law, gain, dynamic, auto, pause, step, png, raw } = this.controls;
    view.onchange = () => this.layOut();
    for (const control of [map, law, gain, dynamic]) control.oninput = () => this.restyle();
    auto.onchange = () => { this.held = this.image.ceiling; this.restyle(); };
    pause.onclick = () => this.pause(this.paused ? "go" : "pause");
    step.onclick = () => this.pause("step");
    png.onclick = () => this.save("png");
    raw.onclick = () => this.save("raw");
    this.over.onmousemove = (event) => { this.pointer = [event.offsetX, event.offsetY]; this.read(); };
    this.over.onmouseleave = () => { this.pointer = null; this.read(); };
  }

  pause(kind) {
    this.paused = kind !== "go";
    this.controls.pause.textContent = this.paused ? "go on" : "pause";
    this.controls.pause.classList.toggle("on", this.paused);
    this.link.say({ kind, source: this.source });
  }

  // After a lost connection the server knows nothing of this page.
  again() {
    this.pending = 0;
    if (this.paused) this.pause("pause");
  }

  save(what) {
    const tone = this.tone();
    this.link.say({ kind: "save", what, source: this.source, view: this.controls.view.value,
      colour_map: this.controls.map.value, ceiling: tone.ceiling, dynamic_range: tone.range });
  }

  // A new image: drawn with the browser's next frame, and only then is the next one asked for.
  take(message) {
    const first = !this.image.beams;
    if (this.image.take(message) || first) this.layOut();
    if (this.controls.auto.checked && this.ceiling !== message.ceiling) {
      this.ceiling = message.ceiling;
      this.image.stale = true;
    }
    if (this.pending++) return;
    requestAnimationFrame(() => {
      this.draw();
      for (; this.pending > 0; this.pending--) this.link.say({ kind: "drawn", source: this.source });
    });
  }

  tone() {
    const { law, gain, dynamic, auto } = this.controls;
    const base = (auto.checked ? this.image.ceiling : this.held) || 1;
    return { ceiling: base * 10 ** (-gain.value / 10), range: law.value === "db" ? Number(dynamic.value) : 0 };
  }

  restyle() {
    this.image.stale = true;
    if (this.table) this.draw();
  }

  // Width that the picture may have [CSS pixels]: all of the panel's, or less, so that its height fits the window.
  roomFor(polar) {
    const style = getComputedStyle(this.node);
    const width = this.node.clientWidth - parseFloat(style.paddingLeft) - parseFloat(style.paddingRight);
    if (!this.image.beams || width < 1) return 0;
    const { edges } = this.image.edges(), [left, right, bottom, top] = sectorBox(edges[0], edges[edges.length - 1], 1);
    const slope = polar ? 0.7 : Math.min(0.88, (0.92 * (top - bottom)) / (left - right) + 0.08);
    return Math.floor(Math.min(width, Math.max(200, window.innerHeight - BESIDES) / slope));
  }

  // Choose the picture's size and make its table.
  layOut() {
    const polar = this.controls.view.value === "polar", width = this.roomFor(polar);
    if (!width) return;
    this.stage.style.width = `${width}px`;
    const scale = Math.min(window.devicePixelRatio || 1, MAX_PIXELS / width);
    const pixels = Math.max(64, Math.round(width * scale));
    this.table = polar ? polarTable(this.image, pixels, Math.round(pixels * 0.7)) : fanTable(this.image, pixels * 0.92, pixels * 0.8);
    const { width: w, height: h } = this.table;
    const [mx, my] = polar ? [0, 0] : [(pixels - w) / 2, pixels * 0.04];
    this.margin = [Math.max(0, Math.round(mx)), Math.round(my)];
    for (const canvas of [this.under, this.over]) {
      canvas.width = w + 2 * this.margin[0];
      canvas.height = h + 2 * this.margin[1];
    }
    this.stage.style.aspectRatio = `${this.under.width} / ${this.under.height}`;
    this.context = this.under.getContext("2d");
    this.picture = this.context.createImageData(w, h);
    this.words = new Uint32Array(this.picture.data.buffer);
    this.image.stale = true;
    this.draw();
  }

  draw() {
    if (!this.table || !this.image.beams) return;
    this.image.colour(this.tone(), this.colours.maps[this.controls.map.value], this.colours.noData, false);
    const { index } = this.table, { words } = this, { colours } = this.image;
    for (let i = 0; i < index.length; i++) words[i] = index[i] < 0 ? 0 : colours[index[i]];
    this.context.putImageData(this.picture, this.margin[0], this.margin[1]);
    this.drawOver();
    this.drawScale();
    this.read();
    this.node.dataset.time = this.image.time;
    this.node.dataset.drawn = (Number(this.node.dataset.drawn) || 0) + 1;
  }

  // Rings, ticks and head line, over the picture.
  drawOver() {
    const g = this.over.getContext("2d");
    g.clearRect(0, 0, this.over.width, this.over.height);
    g.font = `${Math.max(10, Math.round(this.over.width / 70))}px system-ui, sans-serif`;
    g.textAlign = "center";
    g.textBaseline = "middle";
    g.fillStyle = LABEL;
    if (this.controls.view.value === "polar") this.drawPolarGrid(g);
    else this.drawFanGrid(g);
  }

  drawFanGrid(g) {
    const { image } = this, { edges } = image.edges(), first = edges[0], last = edges[edges.length - 1];
    const [ox, oy] = this.toCanvas(0, 0), perMetre = this.table.width / (this.table.extent[0] - this.table.extent[1]);
    g.lineWidth = 1;
    g.strokeStyle = GRID;
    for (const ring of rings(image.reach)) {
      g.beginPath(); // canvas angles run clockwise from its x axis; ahead is up, so bearing b is -90 deg - b
      g.arc(ox, oy, ring * perMetre, -Math.PI / 2 - last, -Math.PI / 2 - first);
      g.stroke();
      if (ring > 0.93 * image.reach) continue; // the bearing's label stands there
      const [x, y] = this.toCanvas(ring * Math.cos(last), ring * Math.sin(last));
      g.textAlign = "right";
      g.fillText(`${round(ring)} m`, x - 6, y + 4);
    }
    g.textAlign = "center";
    for (const tick of ticks(first / DEGREE, last / DEGREE)) {
      const b = tick * DEGREE, far = image.reach * 1.035;
      g.strokeStyle = FAINT;
      this.line(g, this.toCanvas(0, 0), this.toCanvas(image.reach * Math.cos(b), image.reach * Math.sin(b)));
      g.fillText(degrees(tick), ...this.toCanvas(far * Math.cos(b), far * Math.sin(b)));
    }
    if (image.turning && image.head !== null) {
      g.strokeStyle = "#7dff9b";
      g.lineWidth = 2;
      this.line(g, [ox, oy], this.toCanvas(image.reach * Math.cos(image.head), image.reach * Math.sin(image.head)));
    }
  }

  drawPolarGrid(g) {
    const { image } = this, { order } = image.edges(), { width, height } = this.over;
    g.strokeStyle = FAINT;
    g.textAlign = "left";
    for (const ring of rings(image.reach)) {
      const y = height * (1 - ring / image.reach);
      this.line(g, [0, y], [width, y]);
      g.fillText(`${round(ring)} m`, 4, Math.max(8, y));
    }
    g.textAlign = "center";
    const step = Math.max(1, Math.round(image.beams / 8));
    for (let column = Math.floor(step / 2); column < image.beams; column += step) {
      const bearing = this.bearing(order[image.beams - 1 - column]) / DEGREE;
      g.fillText(degrees(bearing), ((column + 0.5) / image.beams) * width, height - 10);
    }
  }

  line(g, from, to) {
    g.beginPath();
    g.moveTo(...from);
    g.lineTo(...to);
    g.stroke();
  }

  bearing(beam) {
    return this.image.turning ? ((beam + 0.5) * 2 * Math.PI) / this.image.beams : this.image.bearings[beam];
  }

  // Forward x and left y [m] to pixels of the canvas.
  toCanvas(x, y) {
    const [left, right, bottom, top] = this.table.extent, { width, height } = this.table;
    return [this.margin[0] + ((left - y) / (left - right)) * width, this.margin[1] + ((top - x) / (top - bottom)) * height];
  }

  // The bar that says which colour is which strength.
  drawScale() {
    const bar = this.node.querySelector(".scale canvas"), g = bar.getContext("2d"), strip = g.createImageData(256, 1);
    new Uint32Array(strip.data.buffer).set(this.colours.maps[this.controls.map.value]);
    g.putImageData(strip, 0, 0);
    const tone = this.tone(), strength = tone.ceiling.toPrecision(3);
    this.node.querySelector(".low").textContent = tone.range ? `-${tone.range} dB` : "0";
    this.node.querySelector(".high").textContent = tone.range ? `0 dB re ${strength}` : strength;
    for (const [control, unit] of [[this.controls.gain, "dB"], [this.controls.dynamic, "dB"]]) {
      control.parentNode.querySelector("output").textContent = `${control.value} ${unit}`;
    }
    this.controls.dynamic.disabled = !tone.range;
  }

  // What stands under the pointer.
  read() {
    const cell = this.pointer && this.cellAt(...this.pointer);
    for (const name of ["beam", "bin", "value"]) delete this.cursor.dataset[name];
    if (!cell) { this.cursor.innerHTML = "&nbsp;"; return; }
    const { beam, bin, range, bearing } = cell, value = this.image.values[beam * this.image.bins + bin];
    Object.assign(this.cursor.dataset, { beam, bin, value });
    const told = Number.isNaN(value) ? "no data" : value.toPrecision(6);
    this.cursor.textContent =
      `range ${range.toFixed(2)} m   bearing ${degrees(bearing / DEGREE, 1)}   value ${told}   (beam ${beam}, bin ${bin})`;
  }

  cellAt(x, y) {
    if (!this.table) return null;
    const scale = this.over.width / this.over.clientWidth, { width, height, extent, index } = this.table;
    const fx = x * scale - this.margin[0], fy = y * scale - this.margin[1];
    const column = Math.floor(fx), row = Math.floor(fy);
    if (column < 0 || row < 0 || column >= width || row >= height) return null;
    const cell = index[row * width + column];
    if (cell < 0) return null;
    const beam = Math.floor(cell / this.image.bins), bin = cell % this.image.bins;
    if (this.controls.view.value === "polar") {
      return { beam, bin, range: (bin + 0.5) * this.image.bin_length, bearing: this.bearing(beam) };
    }
    const ahead = extent[3] - (fy / height) * (extent[3] - extent[2]);
    const left = extent[0] - (fx / width) * (extent[0] - extent[1]);
    return { beam, bin, range: Math.hypot(ahead, left), bearing: Math.atan2(left, ahead) };
  }

  // How old the last image was when the viewer heard that it had been drawn [s]: the viewer's clock at both ends.
  hearAge(age) {
    this.age = age;
    if (age !== null) this.node.dataset.age = age;
  }

  // Rate, age, drops and oddities, as the viewer counts them.
  tell(status) {
    const { image } = this, facts = [`${status.rate.toFixed(1)} ${image.turning ? "beams/s" : "Hz"}`];
    if (this.age !== null) facts.push(`age ${(this.age * 1000).toFixed(0)} ms`);
    facts.push(`dropped ${status.dropped}`, `lost ${status.lost}`);
    if (status.invalid) facts.push(`invalid ${status.invalid}`);
    if (image.beams) facts.push(image.turning ? `${image.bins} bins` : `${image.beams} x ${image.bins}`, `${round(image.reach)} m`);
    this.title.replaceChildren(this.source + " ", Object.assign(document.createElement("span"), { className: "facts", textContent: facts.join(" · ") }));
    const silent = status.since !== null && status.since > 2 ? `no image for ${status.since.toFixed(0)} s` : "";
    this.notice.textContent = [silent, status.notice].filter(Boolean).join("; ");
  }
}

export function rings(reach) {
  const rough = reach / 5, power = 10 ** Math.floor(Math.log10(rough));
  const step = [1, 2, 5, 10, 20, 50].map((s) => s * power).reduce((a, b) => (Math.abs(b - rough) < Math.abs(a - rough) ? b : a));
  return Array.from({ length: Math.floor(reach / step + 1e-9) }, (_, i) => (i + 1) * step);
}

export function ticks(first, last) {
  const most = last - first < 350 ? 9 : 12;
  const step = [1, 2, 5, 10, 15, 30, 45, 90].find((s) => (last - first) / s <= most) ?? 90;
  const found = [];
  for (let t = Math.ceil(first / step - 1e-9) * step; t <= last + 1e-9; t += step) found.push(t);
  return last - first > 359 ? found.filter((t) => t < first + 360 - 1e-6) : found;
}

function degrees(angle, digits = 0) {
  const wrapped = -((((180 - angle) % 360) + 360) % 360 - 180);
  const text = Math.abs(wrapped).toFixed(digits);
  if (Number(text) === 0 || Number(text) === 180) return text + "°";
  return (wrapped > 0 ? "+" : "-") + text + "°";
}

function round(value) {
  return Number(value.toPrecision(6)).toString();
}
