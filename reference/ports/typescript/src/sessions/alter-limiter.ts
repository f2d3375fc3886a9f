/** Limits what the values of replies move (AL-86, AL-87). */

export interface Limits {
  /** Units of a word per cycle. */
  velocity: number[];
  /** Units per cycle, per cycle. */
  acceleration: number[];
}

/** One axis: its speed in units per cycle, and, in a non-cumulative mode, its offset from the path. */
export interface AxisState {
  speed: number;
  position: number;
}

export const AT_REST: AxisState = { speed: 0, position: 0 };
export const MAX_WORD = 0x7fff;
const MIN_WORD = -0x8000;

function clamp(value: number, min: number, max: number): number {
  return Math.min(Math.max(value, min), max);
}

function towards(wanted: number, speed: number, v: number, a: number): number {
  return clamp(clamp(wanted, -v, v), speed - a, speed + a) + 0;
}

/** Cumulative: the speed is the value. */
export function speeds({ speed, position }: AxisState, target: number, v: number, a: number): AxisState {
  return { speed: towards(target, speed, v, a), position };
}

/** Non-cumulative: the position is the value. */
export function positions(axis: AxisState, target: number, v: number, a: number): AxisState {
  const way = target - axis.position;
  return moved(axis, towards(Math.sign(way) * braking(Math.abs(way), a), axis.speed, v, a));
}

/** Non-cumulative, without a target: it brakes, and stays where that ends. */
export function brake(axis: AxisState, v: number, a: number): AxisState {
  return moved(axis, towards(0, axis.speed, v, a));
}

function moved({ position }: AxisState, speed: number): AxisState {
  const end = clamp(position + speed, MIN_WORD, MAX_WORD);
  return { speed: end - position, position: end };
}

/** A reply was not read: the offset is withdrawn. */
export function takenBack({ speed, position }: AxisState): AxisState {
  return { speed: 0, position: clamp(position - speed, MIN_WORD, MAX_WORD) };
}

/** The highest speed from which `a` a cycle stops within a way, this cycle's move included. */
function braking(way: number, a: number): number {
  if (a === 0) return 0;
  const n = Math.floor((Math.floor(Math.sqrt(8 * Math.floor(way / a) + 1)) - 1) / 2);
  const r = Math.floor((way - (a * n * (n + 1)) / 2) / (n + 1));
  return n * a + r;
}
