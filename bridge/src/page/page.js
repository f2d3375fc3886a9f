"use strict";
// What comes from devices and commanders is only ever set as text.
const at = (id) => document.getElementById(id);
const say = (node, text) => { if (node.textContent !== text) node.textContent = text; };
const mark = (node, name) => { if (node.className !== name) node.className = name; };
const whole = new Intl.NumberFormat("en");
const WINDOW = 10_000; // a rate is that of so many milliseconds

const age = (ms) => {
  const s = Math.max(0, Math.round(ms / 1000));
  if (s < 120) return `${s} s`;
  if (s < 7200) return `${Math.floor(s / 60)} min`;
  return s < 172_800 ? `${Math.floor(s / 3600)} h` : `${Math.floor(s / 86_400)} d`;
};
const size = (bytes) => bytes < 1 << 20 ? `${Math.ceil(bytes / 1024)} KiB` : `${(bytes / (1 << 20)).toFixed(bytes < 10 << 20 ? 1 : 0)} MiB`;

/** Records a second, from numbers and when they were seen. */
class Rate {
  seen = [];
  add(now, number) {
    if (this.seen.length && number < this.seen.at(-1)[1]) this.seen = [];
    this.seen.push([now, number]);
    while (this.seen.length > 2 && now - this.seen[1][0] >= WINDOW) this.seen.shift();
    const [then, before] = this.seen[0];
    return now > then ? 1000 * (number - before) / (now - then) : null;
  }
}
const rated = (rate) => rate === null ? "" : rate < 10 ? rate.toFixed(1) : whole.format(Math.round(rate));

/** Keeps a table's rows by their keys, in an order. */
class Rows {
  rows = new Map();
  constructor(body, columns) { Object.assign(this, { body, columns }); }
  show(items) {
    const keys = new Set(items.map((item) => item.key));
    for (const [key, row] of this.rows) if (!keys.has(key)) { row.remove(); this.rows.delete(key); }
    items.forEach((item, place) => {
      let row = this.rows.get(item.key);
      if (!row) {
        row = document.createElement("tr");
        for (const [name, label] of this.columns) {
          const cell = row.insertCell();
          cell.className = name;
          if (label) cell.dataset.name = label;
        }
        this.rows.set(item.key, row);
      }
      mark(row, item.mark);
      item.texts.forEach((text, column) => say(row.cells[column], text));
      if (this.body.rows[place] !== row) this.body.insertBefore(row, this.body.rows[place] ?? null);
    });
  }
}

const cells = new Rows(at("rows"), [["first", ""], ["state", ""], ["", ""], ["", "last"], ["number", "per second"], ["number", "number"], ["why wide", ""]]);
const orders = new Rows(at("orders"), [["state", ""], ["first", ""], ["", "id"], ["", ""], ["why wide", ""]]);
const rates = new Map(), all = new Rate();
const OUTCOMES = { accepted: ["under way", "warn"], done: ["done", "good"], refused: ["refused", "bad"], partial: ["partial", "bad"], unknown: ["unknown", "bad"] };
const WORST = { bad: 0, warn: 1, good: 2 };

function cell(now, it) {
  if (!rates.has(it.name)) rates.set(it.name, new Rate());
  const rate = rates.get(it.name).add(now, it.number);
  const [state, level] = !it.alive ? ["dead", "bad"] : it.held ? ["held", "warn"] : ["alive", "good"];
  const why = it.held ? `the broker refuses its topic: ${whole.format(it.held)} records held` : it.why;
  const last = it.last ? `${age(now - it.last)} ago` : "none yet";
  const texts = [it.name, `${state} ${it.since ? age(now - it.since) : ""}`, it.link, last, rated(rate), whole.format(it.number), why];
  return { key: it.name, mark: level, texts };
}

function show(view) {
  const { now, broker, store, commands, shared } = view;
  const where = shared ? `; shared cells: ${shared.here} here, ${shared.elsewhere} elsewhere, ${shared.nobody} without owner` : "";
  document.title = `${broker.group} / ${broker.node}`;
  say(at("name"), document.title);
  say(at("broker-state"), broker.online ? "online" : "offline");
  say(at("broker-why"), (broker.online ? broker.address : broker.why || broker.address) + where);
  mark(at("broker"), `tile ${broker.online ? "good" : "bad"}`);
  say(at("store-records"), store.stuck ? "stuck" : `${whole.format(store.records)} wait`);
  // There is no limit before the bridge has said one.
  const level = store.limit ? 100 * store.bytes / store.limit : 0;
  at("store-level").value = level;
  const lost = store.dropped ? `; ${whole.format(store.dropped)} dropped` : "";
  say(at("store-why"), store.stuck ? "the store cannot be written" : `${size(store.bytes)} of ${size(store.limit)}${lost}`);
  mark(at("store"), `tile ${store.stuck || store.dropped ? "bad" : level > 50 ? "warn" : "good"}`);
  const shown = view.cells.map((it) => cell(now, it)).sort((a, b) => WORST[a.mark] - WORST[b.mark] || (a.key < b.key ? -1 : 1));
  cells.show(shown);
  const count = (level) => shown.filter((it) => it.mark === level).length;
  say(at("cells-alive"), `${shown.length - count("bad")} of ${shown.length} alive`);
  say(at("cells-why"), [[count("bad"), "dead"], [count("warn"), "held"]].filter(([n]) => n).map((it) => it.join(" ")).join(", "));
  mark(at("cells"), `tile ${count("bad") ? "bad" : count("warn") ? "warn" : "good"}`);
  say(at("rate"), `${rated(all.add(now, view.records)) || "–"} /s`);
  say(at("records-why"), `${whole.format(view.records)} since the start`);
  const open = commands.filter((it) => it.outcome === "accepted").length;
  say(at("commands-open"), `${open} under way`);
  say(at("commands-why"), Object.entries(view.counts).filter(([, n]) => n).map(([name, n]) => `${whole.format(n)} ${name.replace("_", " ")}`).join(", "));
  orders.show(commands.map((it) => {
    const [word, level] = OUTCOMES[it.outcome] ?? [it.outcome, "warn"];
    return { key: `${it.cell}/${it.id}`, mark: level, texts: [word, it.cell, it.id, `${age(now - it.at)} ago`, it.detail] };
  }));
  at("none").hidden = commands.length > 0;
}

let heard = Date.now();
const events = new EventSource("events");
events.onmessage = ({ data }) => {
  heard = Date.now();
  show(JSON.parse(data));
};
setInterval(() => {
  const silence = Date.now() - heard, stale = silence > 4000;
  document.body.classList.toggle("stale", stale);
  say(at("news"), stale ? `no data from the bridge for ${age(silence)}` : "live");
}, 500);
