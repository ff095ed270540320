// One sonar: its picture, rings and ticks, cursor, and the controls of how it is shown.

import { DEGREE, LABEL, degrees, drawFanGrid, drawPolarGrid, round } from "./grid.js";
import { Image, fanTable, polarTable, sectorBox } from "./image.js";

const MAX_PIXELS = 1200; // [-] of the longer side: more is not in the image, and costs time on large screens
const BESIDES = 210; // [CSS pixels] of height that the header, the controls and the readings take

const MARKUP = `
  <h2></h2>
  <div class="bar">
    <select class="view" title="view"><option value="fan">fan</option><option value="polar">polar, raw</option></select>
    <select class="map" title="colour map"></select>
    <select class="law" title="scale"><option value="db">dB</option><option value="linear">linear</option></select>
    <label>gain <input class="gain" type="range" min="-20" max="20" step="1" value="0"><output></output></label>
    <label title="echoes so far below the strongest are black">dyn. range <input class="dynamic" type="range" min="10" max="80" step="5" value="40"><output></output></label>
    <label title="brightness follows the strongest echoes"><input class="auto" type="checkbox" checked>auto</label>
    <button class="pause">pause</button><button class="step">step</button>
    <button class="png">save PNG</button><button class="raw">save raw</button>
    <button class="settings" title="range, gain, bins, noise and whatever else this sonar's task can be told">settings</button>
  </div>
  <div class="stage"><canvas class="under"></canvas><canvas class="over"></canvas></div>
  <div class="scale"><span class="low"></span><canvas width="256" height="1"></canvas><span class="high"></span><span class="gaps" hidden>no data</span></div>
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
    this.gaps = find(".gaps");
    this.gaps.style.borderColor = `#${[0, 8, 16].map((shift) => ((colours.noData >> shift) & 255).toString(16).padStart(2, "0")).join("")}`;
    this.controls = Object.fromEntries(
      ["view", "map", "law", "gain", "dynamic", "auto", "pause", "step", "png", "raw", "settings"].map((n) => [n, find("." + n)]));
    for (const name of Object.keys(colours.maps)) this.controls.map.add(new Option(name, name));
    this.wire();
    new ResizeObserver(() => this.layOut()).observe(this.node);
    window.addEventListener("resize", () => this.layOut());
  }

  wire() {
    const { view, map, law, gain, dynamic, auto, pause, step, png, raw, settings } = this.controls;
    view.onchange = () => this.layOut();
    for (const control of [map, law, gain, dynamic]) control.oninput = () => this.restyle();
    auto.onchange = () => { this.held = this.image.ceiling; this.restyle(); };
    pause.onclick = () => this.pause(this.paused ? "go" : "pause");
    step.onclick = () => this.pause("step");
    png.onclick = () => this.save("png");
    raw.onclick = () => this.save("raw");
    settings.onclick = () => this.openSettings();
    this.over.onmousemove = (event) => { this.pointer = [event.offsetX, event.offsetY]; this.read(); };
    this.over.onmouseleave = () => { this.pointer = null; this.read(); };
  }

  // The properties of this sonar's task, in the list of tasks.
  openSettings() {
    const task = document.querySelector(`[data-task="${this.source.split(".")[0]}"]`);
    if (!task) return;
    task.querySelector("details").open = true;
    task.scrollIntoView({ behavior: "smooth", block: "start" });
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
    const anew = this.image.stale; // another size, shape, tone or colour map: then rings and colour bar change too
    this.image.colour(this.tone(), this.colours.maps[this.controls.map.value], this.colours.noData, false);
    const { index } = this.table, { words } = this, { colours } = this.image;
    for (let i = 0; i < index.length; i++) words[i] = index[i] < 0 ? 0 : colours[index[i]];
    this.context.putImageData(this.picture, this.margin[0], this.margin[1]);
    if (anew || this.image.turning) this.drawOver();
    if (anew) this.drawScale();
    this.gaps.hidden = !this.image.hasGaps;
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
    if (this.controls.view.value === "polar") drawPolarGrid(this, g);
    else drawFanGrid(this, g);
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
