// Rings, bearing ticks and head line over a picture, and how numbers are written.

export const DEGREE = Math.PI / 180;
export const LABEL = "rgba(255,255,255,0.8)";
const GRID = "rgba(255,255,255,0.35)", FAINT = "rgba(255,255,255,0.14)", HEAD = "#7dff9b";

export function drawFanGrid(panel, g) {
  const { image } = panel, { edges } = image.edges(), first = edges[0], last = edges[edges.length - 1];
  const [ox, oy] = panel.toCanvas(0, 0), perMetre = panel.table.width / (panel.table.extent[0] - panel.table.extent[1]);
  g.lineWidth = 1;
  g.strokeStyle = GRID;
  for (const ring of rings(image.reach)) {
    g.beginPath(); // canvas angles run clockwise from its x axis; ahead is up, so bearing b is -90 deg - b
    g.arc(ox, oy, ring * perMetre, -Math.PI / 2 - last, -Math.PI / 2 - first);
    g.stroke();
    if (ring > 0.93 * image.reach) continue; // the bearing's label stands there
    const [x, y] = panel.toCanvas(ring * Math.cos(last), ring * Math.sin(last));
    g.textAlign = "right";
    g.fillText(`${round(ring)} m`, x - 6, y + 4);
  }
  g.textAlign = "center";
  for (const tick of ticks(first / DEGREE, last / DEGREE)) {
    const b = tick * DEGREE, far = image.reach * 1.035;
    g.strokeStyle = FAINT;
    line(g, panel.toCanvas(0, 0), panel.toCanvas(image.reach * Math.cos(b), image.reach * Math.sin(b)));
    g.fillText(degrees(tick), ...panel.toCanvas(far * Math.cos(b), far * Math.sin(b)));
  }
  if (image.turning && image.head !== null) {
    g.strokeStyle = HEAD;
    g.lineWidth = 2;
    line(g, [ox, oy], panel.toCanvas(image.reach * Math.cos(image.head), image.reach * Math.sin(image.head)));
  }
}

export function drawPolarGrid(panel, g) {
  const { image } = panel, { order } = image.edges(), { width, height } = panel.over;
  g.strokeStyle = FAINT;
  g.textAlign = "left";
  for (const ring of rings(image.reach)) {
    const y = height * (1 - ring / image.reach);
    line(g, [0, y], [width, y]);
    g.fillText(`${round(ring)} m`, 4, Math.max(8, y));
  }
  g.textAlign = "center";
  const step = Math.max(1, Math.round(image.beams / 8));
  for (let column = Math.floor(step / 2); column < image.beams; column += step) {
    const bearing = panel.bearing(order[image.beams - 1 - column]) / DEGREE;
    g.fillText(degrees(bearing), ((column + 0.5) / image.beams) * width, height - 10);
  }
}

function line(g, from, to) {
  g.beginPath();
  g.moveTo(...from);
  g.lineTo(...to);
  g.stroke();
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

export function degrees(angle, digits = 0) {
  const wrapped = -((((180 - angle) % 360) + 360) % 360 - 180);
  const text = Math.abs(wrapped).toFixed(digits);
  if (Number(text) === 0 || Number(text) === 180) return text + "°";
  return (wrapped > 0 ? "+" : "-") + text + "°";
}

export function round(value) {
  return Number(value.toPrecision(6)).toString();
}
