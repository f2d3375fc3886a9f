// Answers the requests of reference/checks/testee.py: node testee.mjs CELLWIRE_JS
import { createInterface } from "node:readline";
import { pathToFileURL } from "node:url";

const { load, Refused, stringify } = await import(pathToFileURL(process.argv[2]).href);
const cellwire = await load();
const known = new Map(cellwire.links.map((link) => [link.name, link]));
const hex = (bytes) => Buffer.from(bytes).toString("hex").toUpperCase();
const unhex = (text) => Buffer.from(text.replaceAll(" ", ""), "hex");

/** JSON whose integers of more than 15 digits are bigint. */
function parse(text) {
  const marked = text.replace(/"(?:[^"\\]|\\.)*"|(?<![\d.])\d{16,}(?![\d.eE])/g, (token) => token[0] === '"' ? token : `"bigint ${token}"`);
  return JSON.parse(marked, (_, value) => typeof value === "string" && value.startsWith("bigint ") ? BigInt(value.slice(7)) : value);
}

function decode({ link, hex, read, ...side }) {
  const stream = cellwire.decoder(link, side), items = [];
  for (const part of hex.split("|").slice(0, -1)) {
    const bytes = unhex(part);
    for (let at = 0; at < bytes.length; at += read || bytes.length) items.push(...stream.push(bytes.subarray(at, at + (read || bytes.length))));
    items.push(...stream.finish());
  }
  stream.free();
  return { items };
}

function step(session, { at, do: input, hold, keep }) {
  const now = BigInt(at), done = { events: [], transmit: [] };
  const [name, argument] = Object.entries(input)[0];
  const inputs = {
    connected: () => session.handleConnected(now),
    disconnected: () => session.handleDisconnected(now),
    timeout: () => session.handleTimeout(now),
    transmitted: () => session.handleTransmitted(now),
    input: () => session.handleInput(unhex(argument), now),
    nothing() {},
  };
  try {
    (inputs[name] ?? (() => session.call(name, argument, now)))();
  } catch (error) {
    if (!(error instanceof Refused)) throw error;
    done.refused = error.refusal;
  }
  for (let idle = false; !idle;) {
    idle = true;
    for (let event; !keep && (event = session.pollEvent()) !== null; idle = false) done.events.push(event);
    for (let bytes; !hold && (bytes = session.pollTransmit(now)) !== null; idle = false) done.transmit.push(hex(bytes));
  }
  return { ...done, deadline: session.pollTimeout() };
}

function play({ link, end, config, steps }) {
  const session = cellwire.session(link, end, config);
  const done = steps.map((each) => step(session, each));
  session.free();
  return { steps: done };
}

const tasks = {
  decode,
  stream: decode,
  encode: ({ link, message, ...side }) => ({ hex: hex(cellwire.encode(link, message, side)) }),
  session: play,
};

for await (const line of createInterface({ input: process.stdin })) {
  const request = parse(line), task = tasks[request.task];
  let answer = { skipped: "not of the table" };
  try {
    if (task && known.has(request.link)) answer = task(request);
  } catch (error) {
    if (!(error instanceof Refused)) throw error;
    answer = { refused: error.message };
  }
  console.log(stringify(answer));
}
