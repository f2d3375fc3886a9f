/** What the port answers to a request of the checks. */

import { Refused } from "./src/check.js";
import type { ItemReader } from "./src/stream.js";
import { NEVER, type Session } from "./src/sessions/session.js";
import { Ball, type Measurement } from "./src/sessions/ball.js";
import { BallHost } from "./src/sessions/ball-host.js";
import { AlterHost } from "./src/sessions/alter-host.js";
import type { Policy } from "./src/sessions/alter-host-config.js";
import { AlterController } from "./src/sessions/alter-controller.js";
import type { Job } from "./src/kawasaki-dialect.js";
import { KawasakiPc, type OrderRequest, type ResumeRequest } from "./src/sessions/kawasaki-pc.js";
import { KawasakiRobot } from "./src/sessions/kawasaki-robot.js";
import { LaserController } from "./src/sessions/laser-controller.js";
import { LaserHost } from "./src/sessions/laser-host.js";
import type { ErrorCode, Instruction } from "./src/sessions/laser-words.js";
import { MmaCentral } from "./src/sessions/mma-central.js";
import { MmaDevice, type Order } from "./src/sessions/mma-device.js";
import { ModbusClient } from "./src/sessions/modbus-client.js";
import { ModbusServer } from "./src/sessions/modbus-server.js";
import { MemoryTables } from "./src/sessions/modbus-tables.js";
import { ViewerHost } from "./src/sessions/viewer-host.js";
import { Workstation } from "./src/sessions/workstation.js";
import * as ball from "./src/isra-ball.js";
import * as laser from "./src/laser-eb90.js";
import * as cell from "./src/mmacell-proto.js";
import * as kawasaki from "./src/kawasaki-msg.js";
import * as alter from "./src/val2-alter.js";
import { AlterDecoder } from "./src/alter-decoder.js";
import * as modbus from "./src/fanuc-hmi-modbus.js";
import type { Sender } from "./src/modbus-pdu.js";
import * as ls from "./src/fanuc-ls.js";
import { readDocument, readProgram, textOf } from "./src/ls-read.js";
import { writeProgram } from "./src/ls-write.js";
import * as viewer from "./src/val2-viewer.js";
import { valueOf } from "./testee-values.js";

interface Request {
  task: string;
  link: string;
  options?: Record<string, unknown>;
  from?: string;
  hex?: string;
  read?: number;
  message?: unknown;
  end?: string;
  config?: Record<string, unknown>;
  steps?: Step[];
  given?: Record<string, unknown>;
}

interface Step {
  at: number;
  do: Record<string, unknown>;
  hold?: boolean;
  keep?: boolean;
}

interface Codec {
  decoder(options: object, from: string): ItemReader<unknown, unknown>;
  encode(message: never, options: object, from: string): Uint8Array;
}

const CODECS: Record<string, Codec> = {
  "isra-ball": {
    decoder: () => new ball.BallDecoder(),
    encode: (message) => ball.encodePacket(message),
  },
  "val2-viewer": {
    decoder: () => new viewer.ViewerDecoder(),
    encode: (message) => viewer.encodePose(message),
  },
  "laser-eb90": {
    decoder: (options) => new laser.LaserDecoder(laser.profileOf(options)),
    encode: (message, options) => laser.encodeFrame(message, laser.profileOf(options)),
  },
  "kawasaki-msg": {
    decoder: (options) => new kawasaki.MessageDecoder(charsetOf(options)),
    encode: (message, options) => kawasaki.encodeMessage(message, charsetOf(options)),
  },
  "val2-alter": {
    decoder: (options, from) => new AlterDecoder(from as alter.Side, { ...alter.DEFAULT_FRAMING, ...options }),
    encode: (message, options, from) => alter.encodeMessage(message, from as alter.Side, { ...alter.DEFAULT_FRAMING, ...options }),
  },
  "fanuc-hmi-modbus": {
    decoder: (options, from) => new modbus.ModbusDecoder(from as Sender, framingOf(options)),
    encode: (message, options, from) => modbus.encodeFrame(message, from as Sender, framingOf(options)),
  },
  "mmacell-proto": {
    decoder: (options, from) => {
      const dialect = { ...cell.STRICT, ...options };
      return from === "central" ? new cell.CommandDecoder(dialect) : new cell.ReplyDecoder(dialect, from as cell.Device);
    },
    encode: (message, options, from) => {
      const dialect = { ...cell.STRICT, ...options };
      return from === "central" ? cell.encodeCommand(message, dialect) : cell.encodeReply(message, from as cell.Device, dialect);
    },
  },
};

function charsetOf(options: { charset?: kawasaki.Charset }): kawasaki.Charset {
  return options.charset ?? "ascii";
}

function framingOf(options: { framing?: modbus.Framing }): modbus.Framing {
  return options.framing ?? "tcp";
}

/** JSON, in which a negative zero keeps its sign. */
function toJson(value: object): string {
  const mark = "\u0000-0";
  const text = JSON.stringify(value, (_, element: unknown) => (Object.is(element, -0) ? mark : element));
  return text.replaceAll(JSON.stringify(mark), "-0.0");
}

function bytesOfHex(hex: string): Uint8Array {
  return Uint8Array.from(hex.replace(/\s/g, "").match(/../g) ?? [], (pair) => parseInt(pair, 16));
}

function hexOf(bytes: Uint8Array): string {
  return Array.from(bytes, (byte) => byte.toString(16).toUpperCase().padStart(2, "0")).join("");
}

function decode(decoder: ItemReader<unknown, unknown>, hex: string, read: number): object[] {
  const items: object[] = [];
  const take = (marks: object): void => {
    for (let item = decoder.next(); item !== null; item = decoder.next()) items.push({ ...item, ...marks });
  };
  const pieces = hex.trim().replace(/\|$/, "").split("|");
  for (const bytes of pieces.map(bytesOfHex)) {
    const size = read === 0 ? bytes.length : read;
    for (let at = 0; at < bytes.length; at += size) {
      decoder.push(bytes.subarray(at, at + size));
      take({});
    }
    decoder.end();
    take({ end: true });
  }
  return items;
}

/** A session of an end, and the calls of its user. */
interface End {
  session: Session<object>;
  /** A call may give events of its own, which come first. */
  calls: Record<string, (argument: never, now: number) => unknown>;
}

/** Times of a configuration: null is never. */
function times(config: Record<string, unknown>): object {
  return Object.fromEntries(Object.entries(config).map(([name, value]) => [name, value === null ? NEVER : value]));
}

/** A stall is the silence of RTU over TCP. */
function modbusTimes({ stall, ...config }: Record<string, unknown>): object {
  return times(stall === undefined ? config : { ...config, silence: stall });
}

const ENDS: Record<string, (config: Record<string, unknown>) => End> = {
  "isra-ball/host": (config) => ({ session: new BallHost(times(config)), calls: {} }),
  "isra-ball/ball": (config) => {
    const session = new Ball(config);
    return { session, calls: { measure: (values: Measurement) => session.measure(values) } };
  },
  "val2-viewer/host": (config) => {
    const session = new ViewerHost(times(config));
    return { session, calls: { set_pose: (words: number[], now) => session.setPose(words, now) } };
  },
  "val2-viewer/workstation": (config) => {
    const session = new Workstation(times(config));
    return { session, calls: { draw: (_: never, now) => session.draw(now) } };
  },
  "mmacell-proto/central": (config) => {
    const session = new MmaCentral("platform", times(config));
    return { session, calls: { request: (command: cell.Command) => session.request(command), abort: () => session.abort() } };
  },
  "mmacell-proto/device": (config) => {
    const session = new MmaDevice("platform", config);
    const asked = (): Order => session.asked ?? { order: "stop" };
    return {
      session,
      calls: {
        accept: () => session.accept(asked()),
        accept_another: () => session.accept({ order: "acquire", camera: -1 }),
        refuse: (error: number) => session.refuse(asked(), error),
        set_pose: (axes: number[]) => session.setPose(axes),
        arrived: () => session.arrived(),
        fail: (error: number) => session.fail(error),
      },
    };
  },
  "laser-eb90/host": (config) => {
    const session = new LaserHost(times(config));
    const submit = ({ word, parameters = [] }: Partial<Instruction> & { word: number }): number => session.submit({ word, parameters });
    return { session, calls: { submit, take_back: () => session.takeBack(), resume: () => session.resume() } };
  },
  "laser-eb90/controller": ({ queue: places = 8, ...config }) => {
    const queue: Instruction[] = [];
    const session = new LaserController(
      {
        takes: ({ parameters }) => !parameters.some((item) => "char" in item),
        hasRoom: (count) => queue.length + count <= Number(places),
        add: (instruction) => queue.push(instruction),
      },
      times(config),
    );
    return {
      session,
      calls: {
        answer: (items: laser.LaserItem[], now) => session.answer(items, now),
        refuse: (error: ErrorCode, now) => session.refuse(error, now),
        take: (count: number) => queue.splice(0, count).map((instruction) => ({ event: "taken", ...instruction })),
      },
    };
  },
  "kawasaki-msg/pc": (config) => {
    const session = new KawasakiPc(times(config));
    return {
      session,
      calls: {
        start: (order: OrderRequest) => session.start(order),
        add: (jobs: Job[]) => session.add(jobs),
        close: () => session.close(),
        resume: (order: ResumeRequest) => session.resume(order),
        end: () => session.end(),
        interrupt: () => session.interrupt(),
        command: ({ id, value }: { id: number; value: number }) => session.command(id, value),
      },
    };
  },
  "kawasaki-msg/robot": (config) => {
    // The low water has a null of its own: half of the queue.
    const given = { ...times(config), ...("low_water" in config ? { low_water: config.low_water as number | null } : {}) };
    const session = new KawasakiRobot(given);
    const taken = (number: number | null): object[] => {
      const { order, number: found, job } = session.take(number);
      return [{ event: "taken", order, number: found, job }];
    };
    return {
      session,
      calls: {
        take: taken,
        report: (number: number) => session.report(number),
        complete: () => session.complete(),
        execute: () => {
          const [event] = taken(null);
          session.report((event as { number: number }).number);
          session.complete();
          return [event];
        },
        clear_queue: () => session.clearQueue(),
        reset_order: () => session.resetOrder(),
        abandon: () => session.abandon(),
      },
    };
  },
  "val2-alter/host": (config) => {
    const session = new AlterHost(times(config));
    return {
      session,
      calls: {
        set_target: (words: number[], now) => session.setTarget(words, now),
        clear_target: () => session.clearTarget(),
        stop: () => session.stop(),
        set_policy: (policy: Policy) => session.setPolicy(policy),
        set_subroutine: (subroutine: boolean) => session.setSubroutine(subroutine),
        exception: (code: number) => session.startException(code),
      },
    };
  },
  "val2-alter/controller": (config) => {
    const session = new AlterController(times(config));
    return {
      session,
      calls: {
        start: (_: never, now) => session.start(now),
        finish: () => session.finish(),
        interrupt: () => session.interrupt(),
        resume: () => session.resume(),
        set_segment: ([status = 0, number = 0, percent = 0]: number[]) => session.setSegment(status, number, percent),
        set_transform: (words: number[]) => session.setTransform(words),
      },
    };
  },
  "fanuc-hmi-modbus/client": (config) => {
    const session = new ModbusClient(modbusTimes(config));
    return { session, calls: { request: (request: modbus.RequestMessage) => session.request(request) } };
  },
  "fanuc-hmi-modbus/server": ({ unit, ...config }) => ({
    session: new ModbusServer(serverTables(), { ...modbusTimes(config), ...(unit === undefined ? {} : { unit: unit as number | null }) }),
    calls: {},
  }),
};

/** The tables of the server in the stories (README). */
function serverTables(): MemoryTables {
  const addresses = Array.from({ length: 100 }, (_, address) => address);
  const coils = addresses.map((address) => address % 3 === 0);
  return new MemoryTables(
    {
      coils,
      get discreteInputs() {
        return coils.map((isOn) => !isOn);
      },
      holdingRegisters: addresses.map((address) => 7 * address),
    },
    {
      65: (request) => request,
      66: () => ({ function: 66, data: new Array<number>(300).fill(0) }),
      67: () => 6,
    },
  );
}

function eventsOf(result: unknown): object[] {
  return Array.isArray(result) ? (result as object[]) : [];
}

function play({ session, calls }: End, steps: Step[]): object[] {
  return steps.map((step) => {
    const [[name, argument] = ["nothing", true]] = Object.entries(step.do);
    const now = step.at;
    const inputs: Record<string, () => void> = {
      nothing: () => undefined,
      connected: () => session.connected(now),
      disconnected: () => session.disconnected(now),
      input: () => session.input(bytesOfHex(String(argument)), now),
      timeout: () => session.timeout(now),
      transmitted: () => session.transmitted(now),
    };
    const call = calls[name];
    const events: object[] = [];
    let refused: object = {};
    try {
      if (call !== undefined) events.push(...eventsOf(call(argument as never, now)));
      else inputs[name]?.();
    } catch (refusal) {
      if (!(refusal instanceof Refused)) throw refusal;
      refused = { refused: { kind: refusal.kind } };
    }
    const transmit: string[] = [];
    const nextEvent = (): object | null => (step.keep === true ? null : session.event());
    const nextPiece = (): Uint8Array | null => (step.hold === true ? null : session.transmit(now));
    for (let isOver = false; !isOver; ) {
      isOver = true;
      for (let event = nextEvent(); event !== null; event = nextEvent()) {
        events.push(event);
        isOver = false;
      }
      for (let piece = nextPiece(); piece !== null; piece = nextPiece()) {
        transmit.push(hexOf(piece));
        isOver = false;
      }
    }
    const deadline = session.deadline();
    return { ...refused, events, transmit, deadline: deadline < NEVER ? deadline : null };
  });
}

/** The links of texts: files as a whole. */
function answerLs(request: Request): object {
  const rules: ls.Rules = { ...ls.DEFAULT_RULES, ...request.options };
  const bytes = bytesOfHex((request.hex ?? "").replace("|", ""));
  switch (request.task) {
    case "decode":
      return { items: [{ offset: 0, length: bytes.length, ...readProgram(textOf(bytes)) }] };
    case "stream":
      return { items: readDocument(textOf(bytes), rules) };
    case "encode":
      return encoded(() => new TextEncoder().encode(writeProgram(request.message as ls.Program, rules)));
  }
  return { skipped: "not implemented" };
}

function encoded(encode: () => Uint8Array): object {
  try {
    return { hex: hexOf(encode()) };
  } catch (refusal) {
    if (refusal instanceof Refused) return { refused: refusal.message };
    throw refusal;
  }
}

/** The answer to a request, both as a line of JSON. */
export function answerOf(line: string): string {
  return toJson(answer(JSON.parse(line) as Request));
}

function answer(request: Request): object {
  if (request.link === "fanuc-ls") return answerLs(request);
  if (request.task === "value") return valueOf(request.given ?? {});
  const codec = CODECS[request.link];
  const { options = {}, from = "" } = request;
  if (codec === undefined) return { skipped: "not implemented" };
  switch (request.task) {
    case "decode":
    case "stream":
      return { items: decode(codec.decoder(options, from), request.hex ?? "", request.read ?? 0) };
    case "session": {
      const end = ENDS[`${request.link}/${request.end ?? ""}`];
      if (end === undefined) return { skipped: "not implemented" };
      let begun;
      try {
        begun = end(request.config ?? {});
      } catch (refusal) {
        if (refusal instanceof Refused) return { refused: refusal.message };
        throw refusal;
      }
      return { steps: play(begun, request.steps ?? []) };
    }
    case "encode":
      return encoded(() => codec.encode(request.message as never, options, from));
  }
  return { skipped: "not implemented" };
}
