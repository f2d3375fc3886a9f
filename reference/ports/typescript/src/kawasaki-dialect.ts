/** What the messages of kawasaki-msg mean: the table of messages, and the layout of a job (sections 4 and 5.2). */

import { Refused } from "./check.js";
import { LAST_CHARACTER, encodeMessage, readNumber, type Charset, type Message } from "./kawasaki-msg.js";
import { require } from "./sessions/session.js";

export type Role =
  | "order_start"
  | "order_ack"
  | "job"
  | "job_ack"
  | "job_request"
  | "pause"
  | "order_end"
  | "order_interrupt"
  | "end_ack"
  | "status"
  | "filler"
  | `command_${number}`;

type NumberField = "order" | "number" | "ended" | "phase" | "queued" | "executed" | "value";

/** A field of the table: a number, the job's own fields, a constant, or one that is not looked at (KM-19, KM-27). */
export type TableField = NumberField | "work" | "unused" | `=${string}`;

export interface TableEntry {
  name: string;
  header?: TableField[];
  fields: TableField[];
}

/** A field of a job's own (KM-24); the range of a decimal is in counts of its last decimal. */
export type JobField =
  | { name: string; kind: "whole"; range: [number, number] }
  | { name: string; kind: "decimal"; places: number; range: [number, number] }
  | { name: string; kind: "text"; length: [number, number] };

/** A job: numbers are counts of their last decimal. */
export type Job = Record<string, number | string>;

export type FieldFault =
  | { kind: "missing" }
  | { kind: "not_a_number"; min: number | string; max: number | string }
  | { kind: "too_precise"; places: number }
  | { kind: "out_of_range"; found: number | string; min: number | string; max: number | string }
  | { kind: "reserved" | "character"; found: number | string }
  | { kind: "length"; found: number; min: number; max: number };

export type MeaningError =
  | { kind: "unknown_name"; name: string }
  | { kind: "header"; value: number }
  | { kind: "field_count"; expected: number; found: number }
  | { kind: "not_the_constant" | "not_a_number"; field: number }
  | { kind: "out_of_range"; field: number; found: number; min: number; max: number }
  | { kind: "field"; field: string; fault: FieldFault }
  | { kind: "job_too_long"; found: number; limit: number };

export type Values = Partial<Record<NumberField, number | null>>;

/** What a message means; null is an empty field, and what the table lacks is absent. */
export interface Meaning {
  role: Role;
  values: Values;
  job?: Job;
}

const RANGES: Record<NumberField, [number, number]> = {
  order: [0, 65535],
  ended: [0, 65535],
  phase: [0, 255],
  number: [1, 9999],
  queued: [1, 9999],
  executed: [1, 9999],
  value: [-0x8000_0000, 0x7fff_ffff],
};
const MAY_BE_EMPTY: readonly TableField[] = ["ended", "queued", "executed", "unused"];

const DEFAULT_TABLE: [Role, TableEntry][] = [
  ["order_start", { name: "TilausAlkaa", fields: ["order", "number"] }],
  ["order_ack", { name: "TilausKuittaus", fields: ["order"] }],
  ["job", { name: "Tyo", fields: ["order", "number", "work"] }],
  ["job_ack", { name: "TyoKuittaus", fields: ["order", "number"] }],
  ["job_request", { name: "TyoPyynto", fields: ["order", "number"] }],
  ["pause", { name: "TyoTauko", fields: ["order", "queued"] }],
  ["order_end", { name: "TilausLoppuu", fields: ["order"] }],
  ["order_interrupt", { name: "TilausKeskeytyy", fields: ["order"] }],
  ["end_ack", { name: "LoppuKuittaus", fields: ["ended", "order", "executed"] }],
  ["status", { name: "Tila", fields: ["order", "phase", "queued", "executed", "ended"] }],
  ["filler", { name: "Huuhaa", fields: [] }],
];

const COMMAND = "command_";
const MAY_LACK: readonly Role[] = ["job_ack", "pause", "order_interrupt"];
/** What a message of a table may not lack (KM-28). */
const NEEDED: Partial<Record<Role, TableField[]>> = {
  order_start: ["order"],
  order_ack: ["order"],
  job: ["number", "work"],
  job_ack: ["number"],
  job_request: ["number"],
  end_ack: ["ended", "executed"],
  status: ["order", "queued", "executed"],
};
/** What has to name its order where datagrams may come late (KM-83). */
const OF_AN_ORDER: readonly Role[] = ["job", "job_ack", "job_request", "pause", "order_end", "order_interrupt"];
const MAX_FIELDS = 16;
const LONGEST_NUMBER = 11;
const LONGEST_WORK = 960;

const LIMIT = 9_999_999;
const DEFAULT_JOB: JobField[] = [
  { name: "kind", kind: "whole", range: [1, 2] },
  ...["x1", "y1", "x2", "y2"].map((name): JobField => ({ name, kind: "whole", range: [-LIMIT, LIMIT] })),
];

const MAX_WORK = 1022;
const MAX_NAME = 15;

class MeaningFault extends Error {
  constructor(
    readonly error: MeaningError,
    /** The other fields of a job whose own do not fit. */
    readonly job?: Values,
  ) {
    super(error.kind);
  }
}

/** What a dialect is given; a role that is null is lacking. */
export interface GivenDialect {
  charset?: Charset;
  messages?: Partial<Record<Role, TableEntry | null>>;
  job?: readonly GivenJobField[];
}

/** As JobField, where the range of a decimal may be a text with its decimals. */
export type GivenJobField =
  | { name: string; kind: "whole" | "decimal"; places?: number; range: [number | string, number | string] }
  | Extract<JobField, { kind: "text" }>;

/** A plant's messages (KM-27, KM-28). */
export class Dialect {
  readonly charset: Charset;
  private readonly table: Map<Role, TableEntry>;
  private readonly layout: JobField[];

  constructor({ charset = "ascii", messages = {}, job }: GivenDialect = {}) {
    this.charset = charset;
    const given = Object.entries(messages) as [Role, TableEntry | null][];
    this.table = new Map(DEFAULT_TABLE);
    for (const [role, entry] of given) {
      if (entry === null) this.table.delete(role);
      else this.table.set(role, entry);
    }
    this.layout = job === undefined ? DEFAULT_JOB : job.map(jobField);
    this.check();
  }

  /** Refuses a table that breaks KM-27 or KM-28, and a layout that breaks KM-25. */
  private check(): void {
    const lacking = DEFAULT_TABLE.find(([role]) => !this.table.has(role) && !MAY_LACK.includes(role));
    if (lacking !== undefined) throw new Refused("config", `a table may not lack ${lacking[0]}`);
    if (new Set([...this.table.values()].map(({ name }) => name)).size < this.table.size) throw new Refused("config", "a name is there twice");
    for (const [role, { header = [], fields }] of this.table) {
      const allowed = DEFAULT_TABLE.find(([known]) => known === role)?.[1].fields;
      const named = [...header, ...fields].filter((field) => field !== "unused" && !field.startsWith("="));
      const isWrong =
        new Set(named).size < named.length ||
        named.some((field) => allowed?.includes(field) === false) ||
        (NEEDED[role] ?? []).some((field) => !named.includes(field)) ||
        header.includes("work") ||
        Math.max(header.length, fields.length) > MAX_FIELDS;
      if (isWrong) throw new Refused("config", `the fields of ${role}`);
    }
    const names = new Set(this.layout.map(({ name }) => name));
    if (names.size === 0 || names.size < this.layout.length) throw new Refused("config", "a layout without a field, or with a name twice (KM-24)");
    if (this.longestWork > LONGEST_WORK) throw new Refused("config", `a job's own fields have up to ${LONGEST_WORK} bytes`);
  }

  /** The bytes of a job's own fields, with a mark for each, at their longest values. */
  private get longestWork(): number {
    const sizes = this.layout.map((field) => (field.kind === "text" ? field.length[1] : Math.max(...field.range.map((end) => String(shown(field, end)).length))));
    return sizes.reduce((sum, size) => sum + size + 1, 0);
  }

  /** The bytes of the longest message; a name or a constant that cannot be written is refused (KM-45). */
  get longest(): number {
    const long = (field: TableField): string => {
      if (field === "work") return "0".repeat(this.longestWork - 1);
      return field === "unused" ? "" : field.startsWith("=") ? field.slice(1) : "0".repeat(LONGEST_NUMBER);
    };
    const messages = [...this.table.values()].map(({ name, header = [], fields }) => ({ name, header: header.map(long), fields: fields.map(long) }));
    return Math.max(...messages.map((message) => encodeMessage(message, this.charset).length));
  }

  /** Whether each message that a datagram may bring late names its order (KM-83). */
  get namesOrders(): boolean {
    const entries = OF_AN_ORDER.map((role) => this.table.get(role));
    return entries.every((entry) => entry === undefined || [...(entry.header ?? []), ...entry.fields].includes("order"));
  }

  has(role: Role): boolean {
    return this.table.has(role);
  }

  /** Where a number is among the fields of a message, counted from 0; 0 if it is in the header. */
  placeOfNumber(role: Role): number {
    return Math.max(this.table.get(role)?.fields.indexOf("number") ?? 0, 0);
  }

  /** The message of a role; null, where the table lacks it. */
  write(role: Role, values: Values, job?: Job): Message | null {
    const entry = this.table.get(role);
    if (entry === undefined) return null;
    const text = (field: TableField): string[] => {
      if (field === "work") return job === undefined ? [""] : this.writeJob(job);
      if (field.startsWith("=")) return [field.slice(1)];
      const value = values[field as NumberField]; // an unused field has none
      return [value === null || value === undefined ? "" : String(value)];
    };
    return { name: entry.name, header: (entry.header ?? []).flatMap(text), fields: entry.fields.flatMap(text) };
  }

  /** What a message means (KM-35). */
  read(message: Message): { meaning: Meaning } | { error: MeaningError; job?: Values } {
    try {
      return { meaning: this.meaningOf(message) };
    } catch (fault) {
      if (fault instanceof MeaningFault) return { error: fault.error, ...(fault.job === undefined ? {} : { job: fault.job }) };
      throw fault;
    }
  }

  private meaningOf({ name, header, fields }: Message): Meaning {
    const found = [...this.table].find(([, entry]) => entry.name === name);
    if (found === undefined) throw new MeaningFault({ kind: "unknown_name", name: [...name].slice(0, MAX_NAME).join("") });
    const [role, entry] = found;
    const values: Values = {};
    this.readHeader(entry.header ?? [], header, values);
    const [only] = entry.fields;
    const single = entry.fields.length === 1 && only !== undefined && MAY_BE_EMPTY.includes(only);
    const given = single && fields.length === 0 ? [""] : fields;
    const count = { kind: "field_count", expected: entry.fields.length, found: given.length } as const;
    const work = entry.fields.indexOf("work");
    const behind = work < 0 ? 0 : entry.fields.length - 1 - work;
    if (work >= 0 && given.length < entry.fields.length - 1) throw new MeaningFault(count);
    const end = given.length - behind;
    entry.fields.forEach((field, index) => {
      if (index === work) return;
      const place = work >= 0 && index > work ? end + index - work - 1 : index;
      const text = given[place];
      if (text === undefined) throw new MeaningFault(count);
      const fault = readField(field, text, values);
      if (fault !== null) throw new MeaningFault(fault(place));
    });
    if (work < 0 && given.length > entry.fields.length) throw new MeaningFault(count);
    if (role !== "job") return { role, values };
    try {
      return { role, values, job: this.readJob(given.slice(work, end), entry.fields.length - 1) };
    } catch (fault) {
      throw fault instanceof MeaningFault ? new MeaningFault(fault.error, values) : fault;
    }
  }

  private readHeader(table: TableField[], header: string[], values: Values): void {
    if (table.length === 0) return;
    table.forEach((field, value) => {
      const text = header[value];
      if (text === undefined || readField(field, text, values) !== null) throw new MeaningFault({ kind: "header", value });
    });
    if (header.length > table.length) throw new MeaningFault({ kind: "header", value: table.length });
  }

  /** A job's own fields (KM-36). */
  private readJob(texts: string[], others: number): Job {
    const size = texts.reduce((total, text) => total + text.length + 1, 0);
    if (size > MAX_WORK) throw new MeaningFault({ kind: "job_too_long", found: size + 2, limit: MAX_WORK + 2 });
    const job: Job = {};
    this.layout.forEach((field, index) => {
      const text = texts[index];
      const read = text === undefined ? { fault: { kind: "missing" } as const } : readJobField(field, text);
      if ("fault" in read) throw new MeaningFault({ kind: "field", field: field.name, fault: read.fault });
      job[field.name] = read.value;
    });
    if (texts.length > this.layout.length) {
      throw new MeaningFault({ kind: "field_count", expected: others + this.layout.length, found: others + texts.length });
    }
    return job;
  }

  /** The first field of a job that does not fit, and why (KM-40). */
  unfit(job: Job): { field: string; fault: FieldFault } | null {
    for (const field of this.layout) {
      const fault = this.faultOf(field, job[field.name]);
      if (fault !== null) return { field: field.name, fault };
    }
    return null;
  }

  private faultOf(field: JobField, value: number | string | undefined): FieldFault | null {
    if (value === undefined) return { kind: "missing" };
    if (field.kind === "text") {
      for (const character of String(value)) {
        if ("<>$#".includes(character)) return { kind: "reserved", found: character };
        if (character > LAST_CHARACTER[this.charset]) return { kind: "character", found: character };
      }
      return lengthFault(String(value), field.length);
    }
    return rangeFault(field, Number(value));
  }

  private writeJob(job: Job): string[] {
    return this.layout.map((field) => {
      const value = job[field.name] ?? "";
      return field.kind === "decimal" ? decimalText(Number(value), field.places) : String(value);
    });
  }
}

/** Reads a field of the table into values; or says how its error is made of its place. */
function readField(field: TableField, text: string, values: Values): ((place: number) => MeaningError) | null {
  if (field === "unused") return null;
  if (field.startsWith("=")) return text === field.slice(1) ? null : (place) => ({ kind: "not_the_constant", field: place });
  const name = field as NumberField;
  if (text === "" && MAY_BE_EMPTY.includes(name)) {
    values[name] = null;
    return null;
  }
  const found = readNumber(text);
  if (found === null) return (place) => ({ kind: "not_a_number", field: place });
  const [min, max] = RANGES[name];
  if (found < min || found > max) return (place) => ({ kind: "out_of_range", field: place, found, min, max });
  values[name] = found;
  return null;
}

/** A field in counts of its last decimal; refuses one that can have no value (KM-24). */
function jobField(field: GivenJobField): JobField {
  if (field.kind === "text") {
    require(field.length[0] >= 0 && field.length[0] <= field.length[1], `${field.name} can have no value`);
    return field;
  }
  const { name, kind, places = 0 } = field;
  require(kind === "decimal" ? places >= 1 && places <= 9 : places === 0, `the decimals of ${name}`);
  const count = (end: number | string): number => (typeof end === "string" ? Math.round(Number(end) * 10 ** places) : end);
  const range: [number, number] = [count(field.range[0]), count(field.range[1])];
  require(range[0] <= range[1], `${name} can have no value`);
  return kind === "decimal" ? { name, kind, places, range } : { name, kind, range };
}

/** A count of the last decimal, with exactly so many decimals. */
function decimalText(count: number, places: number): string {
  const digits = String(Math.abs(count)).padStart(places + 1, "0");
  return `${count < 0 ? "-" : ""}${digits.slice(0, -places)}.${digits.slice(-places)}`;
}

function shown(field: Exclude<JobField, { kind: "text" }>, value: number): number | string {
  return field.kind === "decimal" ? decimalText(value, field.places) : value;
}

function rangeFault(field: Exclude<JobField, { kind: "text" }>, value: number): FieldFault | null {
  const [min, max] = field.range;
  if (value >= min && value <= max) return null;
  return { kind: "out_of_range", found: shown(field, value), min: shown(field, min), max: shown(field, max) };
}

function lengthFault(text: string, [min, max]: [number, number]): FieldFault | null {
  const found = [...text].length;
  return found >= min && found <= max ? null : { kind: "length", found, min, max };
}

function readJobField(field: JobField, text: string): { value: number | string } | { fault: FieldFault } {
  if (field.kind === "text") {
    const fault = lengthFault(text, field.length);
    return fault === null ? { value: text } : { fault };
  }
  const [min, max] = field.range;
  const none = { fault: { kind: "not_a_number", min: shown(field, min), max: shown(field, max) } } as const;
  let value: number | null;
  if (field.kind === "whole") {
    value = readNumber(text);
  } else {
    const [, sign = "", whole = "", decimals = ""] = /^[ \t\n\f\r]*(-?)([0-9]*)(?:\.([0-9]*))?[ \t\n\f\r]*$/.exec(text) ?? [];
    if (whole === "" && decimals === "") return none;
    if (/[1-9]/.test(decimals.slice(field.places))) return { fault: { kind: "too_precise", places: field.places } };
    value = readNumber(sign + whole + decimals.slice(0, field.places).padEnd(field.places, "0"));
  }
  if (value === null) return none;
  const fault = rangeFault(field, value);
  return fault === null ? { value } : { fault };
}

/** How many numbers a number is ahead of a count (KM-44). */
export function ahead(count: number, number: number, max: number): number {
  return (number + max - (count % max)) % max;
}

/** The number of the job of a count; null for none (KM-42). */
export function numberOf(count: number, max: number): number | null {
  return count === 0 ? null : numberAfter(count - 1, max);
}

/** The number of the job after that of a count. */
export function numberAfter(count: number, max: number): number {
  return (count % max) + 1;
}

/** What both ends are given. */
interface GivenEnd {
  limits: { element: number; packet: number };
  max_number: number;
  datagrams: boolean;
}

/** Refuses a configuration that breaks KM-43, KM-45 or KM-83. */
export function checkEnd(dialect: Dialect, { limits, max_number, datagrams }: GivenEnd, isIndividual: boolean): void {
  if (dialect.longest > limits.packet || limits.packet > 4096 || limits.element < 1) throw new Refused("config", "the limits of a packet");
  if (max_number < 2 || max_number > 9999) throw new Refused("config", "max_number is out of its range");
  if (isIndividual && !dialect.has("job_ack")) throw new Refused("config", "individual acknowledgement without a job_ack");
  if (datagrams && !dialect.namesOrders) throw new Refused("config", "a message without its order");
}

/** A role as errors show it. */
export type ShownRole = Role | { command: number };

export function shownRole(role: Role): ShownRole {
  return isCommand(role) ? { command: Number(role.slice(COMMAND.length)) } : role;
}

export function isCommand(role: Role): boolean {
  return role.startsWith(COMMAND);
}

const PHASES = ["idle", "starting", "active", "ending", "interrupted", "alarm"] as const;
export type PhaseName = (typeof PHASES)[number] | { other: number };

/** The name of a phase's code (KM-20). */
export function phaseName(code: number): PhaseName {
  return PHASES[code] ?? { other: code };
}
