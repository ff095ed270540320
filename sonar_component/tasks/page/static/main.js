// Joins the page's parts: what comes over the link goes to the panel, the tasks or the camera it belongs to.

import { Link } from "./link.js";
import { Panel } from "./panel.js";
import { Tasks } from "./tasks.js";

const byId = (name) => document.getElementById(name);
const panels = new Map();
let colours = null, early = [];

const link = new Link(hear, (up) => {
  byId("link").textContent = up ? "connected" : "connection to the viewer lost, trying again";
  byId("link").className = up ? "good" : "bad";
  if (up) for (const panel of panels.values()) panel.again();
});
const tasks = new Tasks(byId("tasks"), link);

fetch("colours.json").then((answer) => answer.json()).then((table) => {
  const words = (list) => Uint32Array.from(list, ([r, g, b]) => (255 << 24) | (b << 16) | (g << 8) | r);
  colours = { maps: Object.fromEntries(Object.entries(table.maps).map(([name, list]) => [name, words(list)])), noData: words([table.no_data])[0] };
  for (const message of early) hear(message);
  early = [];
});

function hear(message) {
  if (!colours) { early.push(message); return; }
  if (message.kind === "image") panelOf(message.source).take(message);
  else if (message.kind === "age") panelOf(message.source).hearAge(message.age);
  else if (message.kind === "status") tell(message);
  else if (message.kind === "set") tasks.answer(message);
  else if (message.kind === "notice") notice(message.text);
  else if (message.kind === "camera") showCamera(message);
  else if (message.kind === "file") download(message);
}

function panelOf(source) {
  if (!panels.has(source)) {
    panels.set(source, new Panel(source, colours, link));
    const after = [...panels.keys()].filter((name) => name > source).sort()[0];
    byId("panels").insertBefore(panels.get(source).node, after ? panels.get(after).node : null);
    byId("empty").hidden = true;
  }
  return panels.get(source);
}

function tell(status) {
  for (const [source, facts] of Object.entries(status.sonars)) panelOf(source).tell(facts);
  tasks.tell(status.tasks);
  tellCamera(status.tasks.find((task) => task.type === "CameraTask"));
}

function tellCamera(task) {
  const section = byId("camera"), on = section.querySelector("input");
  const enabled = task?.properties.find((property) => property.name === "enabled")?.value ?? false;
  section.hidden = !task;
  on.checked = enabled;
  on.onchange = () => link.say({ kind: "set", task: task.name, name: "enabled", value: on.checked });
  if (!enabled) section.querySelector("canvas").hidden = true;
}

function notice(text) {
  byId("notice").textContent = text;
  setTimeout(() => { byId("notice").textContent = ""; }, 8000);
}

function download(message) {
  const anchor = document.createElement("a");
  anchor.href = URL.createObjectURL(new Blob([message.content]));
  anchor.download = message.name;
  anchor.click();
  setTimeout(() => URL.revokeObjectURL(anchor.href), 10000);
  notice(`saved ${message.name}`);
}

function showCamera(message) {
  const [height, width, channels] = message.image_shape, canvas = byId("camera").querySelector("canvas");
  canvas.hidden = false;
  const age = message.age === null ? "" : `age ${(message.age * 1000).toFixed(0)} ms`;
  byId("camera").querySelector("span").textContent = `${width} x ${height} ${age}`;
  canvas.width = width;
  canvas.height = height;
  const context = canvas.getContext("2d"), picture = context.createImageData(width, height);
  for (let i = 0, from = 0, to = 0; i < width * height; i++, from += channels, to += 4) {
    for (let c = 0; c < 3; c++) picture.data[to + c] = message.image[from + Math.min(c, channels - 1)];
    picture.data[to + 3] = 255;
  }
  context.putImageData(picture, 0, 0);
  link.say({ kind: "drawn", source: "" });
}

byId("show-tasks").onchange = (event) => { byId("tasks").hidden = !event.target.checked; };
byId("show-world").onchange = (event) => {
  const section = byId("world");
  section.hidden = !event.target.checked;
  byId("side").classList.toggle("wide", event.target.checked);
  section.querySelector("iframe")?.remove(); // a hidden world must not go on drawing
  if (event.target.checked) section.append(Object.assign(document.createElement("iframe"), { src: "world/", title: "3-D world" }));
};
