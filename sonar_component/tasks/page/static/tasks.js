// The tasks of the graph: their state in words, and their properties to be set.

export class Tasks {
  constructor(node, link) {
    this.node = node;
    this.link = link;
    this.rows = new Map();
    node.innerHTML = "<h2>tasks</h2>";
  }

  tell(tasks) {
    const names = new Set(tasks.map((task) => task.name));
    for (const [name, row] of this.rows) {
      if (!names.has(name)) { row.node.remove(); this.rows.delete(name); }
    }
    for (const task of tasks) {
      if (!this.rows.has(task.name)) this.add(task.name);
      this.show(this.rows.get(task.name), task);
    }
  }

  add(name) {
    const node = document.createElement("div");
    node.className = "task";
    node.dataset.task = name;
    node.innerHTML = `<table><tr><td class="name"></td><td class="state"></td></tr><tr><td class="reason" colspan="2"></td></tr></table>
      <details><summary>properties</summary></details>`;
    this.node.append(node);
    this.rows.set(name, { node, fields: new Map() });
  }

  show(row, task) {
    const find = (name) => row.node.querySelector(name);
    const state = find(".state");
    find(".name").textContent = `${task.name} (${task.type})`;
    state.textContent = [task.state, task.substate].filter(Boolean).join(", ");
    state.className = "state " + (task.state === "RUNNING" ? "good" : "bad");
    const restarts = task.restarts ? `restarted ${task.restarts} ${task.restarts === 1 ? "time" : "times"}` : "";
    find(".reason").textContent = [task.reason, restarts].filter(Boolean).join("; ");
    const details = find("details");
    details.hidden = task.properties.length === 0;
    for (const property of task.properties) {
      if (!row.fields.has(property.name)) this.addField(row, details, task.name, property);
      const field = row.fields.get(property.name);
      field.input.disabled = !property.settable;
      if (document.activeElement !== field.input && !field.waiting) write(field.input, property.value);
    }
  }

  addField(row, details, task, property) {
    const line = document.createElement("label");
    line.className = "property";
    line.title = property.description || "";
    const input = document.createElement("input");
    input.type = typeof property.value === "boolean" ? "checkbox" : "text";
    input.name = property.name;
    const refused = Object.assign(document.createElement("span"), { className: "refused", hidden: true });
    line.append(Object.assign(document.createElement("span"), { textContent: property.name }), input, refused);
    details.append(line);
    const field = { input, refused, waiting: false };
    row.fields.set(property.name, field);
    input.onchange = () => {
      field.waiting = true;
      this.link.say({ kind: "set", task, name: property.name, value: read(input) });
    };
  }

  // The answer to a request to set something.
  answer(message) {
    const field = this.rows.get(message.task)?.fields.get(message.name);
    if (!field) return;
    field.waiting = false;
    const said = message.refused ? `refused: ${message.refused}` : message.unanswered ?? "";
    field.refused.hidden = !said;
    field.refused.textContent = said;
    if (!said) { field.input.blur(); write(field.input, message.value); }
  }
}

// Text goes as it was typed, "30 m" or "true"; numbers as numbers, so that a bare one is SI.
function read(input) {
  if (input.type === "checkbox") return input.checked;
  const text = input.value.trim();
  try { return JSON.parse(text); } catch { return text; }
}

function write(input, value) {
  if (input.type === "checkbox") input.checked = Boolean(value);
  else input.value = typeof value === "string" ? value : typeof value === "number" ? Number(value.toPrecision(9)) : JSON.stringify(value);
}
