// Beams x bins, their colours, and the table that says which of them each pixel shows (as pictures/fan.py does).
//
// The table is looked up on the CPU and not by WebGL: a redraw is one pass over the pixels (2 ms for 600 000), it draws
// the same on every machine, also where the browser has no GPU, and the cursor reads the very table that was drawn.

const TURN = 2 * Math.PI;
const LONE_BEAM = Math.PI / 180; // [rad], drawn width of a single beam that does not state its own

export class Image {
  constructor() {
    this.beams = this.bins = 0;
    this.geometry = "";
    this.fresh = [];
  }

  // Take a message; true if its geometry differs from the one before.
  take(message) {
    const turning = message.head !== null;
    if (message.beams !== this.beams || message.bins !== this.bins || message.restarts !== this.restarts) {
      this.values = new Float32Array(message.beams * message.bins).fill(NaN);
      this.colours = new Uint32Array(message.beams * message.bins);
      this.gaps = new Uint8Array(message.beams); // which rows have bins without data
      this.stale = true; // colours of all rows must be made anew
      this.fresh = []; // rows of another shape
    }
    const { beams, bins, restarts, head, time, ceiling, bin_length, bearings } = message;
    Object.assign(this, { beams, bins, restarts, head, time, ceiling, bin_length, bearings, turning });
    this.beam_width = message.beam_width ?? NaN;
    this.fresh.push(message.rows); // several messages may come before the next redraw
    for (let i = 0; i < message.rows.length; i++) {
      this.values.set(message.values.subarray(i * this.bins, (i + 1) * this.bins), message.rows[i] * this.bins);
    }
    const where = turning ? "turn" : bearings.join();
    const geometry = [this.bins, this.bin_length, this.beam_width, where].join("|");
    const changed = geometry !== this.geometry;
    this.geometry = geometry;
    return changed;
  }

  get hasGaps() {
    return this.gaps.includes(1);
  }

  get reach() {
    return this.bins * this.bin_length;
  }

  // Beam centres in rising order and the edges between them [rad].
  edges() {
    if (this.turning) {
      const slot = TURN / this.beams;
      return { order: Array.from({ length: this.beams }, (_, i) => i), edges: Float64Array.from({ length: this.beams + 1 }, (_, i) => i * slot) };
    }
    const order = Array.from(this.bearings.keys()).sort((a, b) => this.bearings[a] - this.bearings[b]);
    const centre = order.map((i) => this.bearings[i]);
    const n = centre.length;
    const edges = new Float64Array(n + 1);
    if (n === 1) {
      const half = (this.beam_width > 0 ? this.beam_width : LONE_BEAM) / 2;
      edges.set([centre[0] - half, centre[0] + half]);
      return { order, edges };
    }
    for (let i = 1; i < n; i++) edges[i] = (centre[i - 1] + centre[i]) / 2;
    edges[0] = 2 * centre[0] - edges[1];
    edges[n] = 2 * centre[n - 1] - edges[n - 1];
    if (edges[n] - edges[0] > TURN) {
      edges[n] = (centre[n - 1] + centre[0] + TURN) / 2;
      edges[0] = edges[n] - TURN;
    }
    return { order, edges };
  }

  // Colour the rows that changed, or all of them where tone or colours did.
  colour(tone, palette, noData, all) {
    const { values, colours, bins } = this;
    const scale = 255 / tone.ceiling, perLog = tone.range > 0 ? (255 * 10) / tone.range : 0, inverse = 1 / tone.ceiling;
    const paint = (row) => {
      let gaps = 0;
      for (let i = row * bins; i < (row + 1) * bins; i++) {
        const v = values[i];
        if (v !== v) { colours[i] = noData; gaps = 1; continue; }
        const level = perLog ? 255 + perLog * Math.log10(v * inverse) : v * scale;
        colours[i] = palette[level >= 255 ? 255 : level > 0 ? (level + 0.5) | 0 : 0];
      }
      this.gaps[row] = gaps;
    };
    if (all || this.stale) for (let row = 0; row < this.beams; row++) paint(row);
    else for (const rows of this.fresh) for (const row of rows) paint(row);
    this.stale = false;
    this.fresh = [];
  }
}

// Which cell each pixel shows: {index, width, height, extent}; extent = [left, right, bottom, top] in metres (fan) or in
// beams and metres (polar).
export function fanTable(image, width, height) {
  const { order, edges } = image.edges();
  const first = edges[0], last = edges[edges.length - 1], reach = image.reach;
  const [left, right, bottom, top] = sectorBox(first, last, reach);
  const pixel = Math.max((left - right) / width, (top - bottom) / height);
  const columns = Math.max(1, Math.round((left - right) / pixel)), rows = Math.max(1, Math.round((top - bottom) / pixel));
  const index = new Int32Array(rows * columns).fill(-1);
  for (let r = 0, at = 0; r < rows; r++) {
    const x = top - ((r + 0.5) * (top - bottom)) / rows;
    for (let c = 0; c < columns; c++, at++) {
      const y = left - ((c + 0.5) * (left - right)) / columns;
      const bin = Math.floor(Math.hypot(x, y) / image.bin_length);
      if (bin >= image.bins) continue;
      let away = (Math.atan2(y, x) - first) % TURN;
      if (away < 0) away += TURN;
      if (away >= last - first) continue;
      index[at] = order[place(edges, first + away)] * image.bins + bin;
    }
  }
  return { index, width: columns, height: rows, extent: [left, right, bottom, top] };
}

export function polarTable(image, width, height) {
  const { order } = image.edges();
  const columns = Math.max(1, Math.min(width, 4096)), rows = Math.max(1, height);
  const index = new Int32Array(rows * columns);
  for (let r = 0, at = 0; r < rows; r++) {
    const bin = Math.min(image.bins - 1, Math.floor(((rows - r - 0.5) / rows) * image.bins));
    for (let c = 0; c < columns; c++, at++) {
      // The leftmost column is the leftmost beam: bearings rise to the left.
      index[at] = order[image.beams - 1 - Math.floor(((c + 0.5) / columns) * image.beams)] * image.bins + bin;
    }
  }
  return { index, width: columns, height: rows, extent: [image.beams, 0, 0, image.reach] };
}

function place(edges, bearing) {
  let low = 0, high = edges.length - 1;
  while (high - low > 1) {
    const middle = (low + high) >> 1;
    if (edges[middle] <= bearing) low = middle;
    else high = middle;
  }
  return low;
}

export function sectorBox(first, last, reach) {
  const corners = [first, last];
  for (let q = Math.ceil(first / (TURN / 4)); (q * TURN) / 4 <= last; q++) corners.push((q * TURN) / 4);
  const x = [0, ...corners.map((b) => reach * Math.cos(b))], y = [0, ...corners.map((b) => reach * Math.sin(b))];
  return [Math.max(...y), Math.min(...y), Math.min(...x), Math.max(...x)];
}
