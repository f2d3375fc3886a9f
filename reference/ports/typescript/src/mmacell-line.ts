/** The fields of a line of mmacell-proto, read from left to right (MM-25). */

export type Expected =
  | "command"
  | "reply"
  | "sign"
  | "digit"
  | "point"
  | "true_or_false"
  | "absolute_or_relative"
  | "on_or_off"
  | "open_or_close"
  | "no_axes";

export type LineError =
  | { kind: "unknown_command" | "unknown_reply"; found: number[] }
  | { kind: "unexpected"; offset: number; found: number; expected: Expected }
  | { kind: "short"; offset: number; expected: Expected }
  | { kind: "trailing"; offset: number }
  | { kind: "integer_range" | "percent"; offset: number; found: number }
  | { kind: "error_zero" };

/** The error of a line, as it is thrown within its decoder. */
export class LineFault extends Error {
  constructor(readonly error: LineError) {
    super(error.kind);
  }
}

/** Reads the content of a line, one byte a character. Offsets count from its first byte. */
export class LineReader {
  private at = 0;

  constructor(private readonly text: string) {}

  get left(): number {
    return this.text.length - this.at;
  }

  /** The first characters of the line. */
  take(count: number, expected: Expected): string {
    if (this.left < count) this.short(expected);
    this.at += count;
    return this.text.slice(this.at - count, this.at);
  }

  /** Skips a text, if it is next. */
  skip(text: string): void {
    if (this.text.startsWith(text, this.at)) this.at += text.length;
  }

  /** One of these characters. */
  oneOf(characters: string, expected: Expected): string {
    const found = this.text[this.at];
    if (found === undefined) this.short(expected);
    if (!characters.includes(found)) this.unexpected(expected);
    this.at += 1;
    return found;
  }

  flag(): boolean {
    return this.oneOf("TF", "true_or_false") === "T";
  }

  /** A coordinate as a count of its last digit, of which `decimals` are behind the point (MM-9). */
  coordinate(decimals: number): number {
    const negative = this.oneOf("+-", "sign") === "-";
    let digits = "";
    for (let place = 6; place > 0; place -= 1) {
      if (place === decimals) this.oneOf(".", "point");
      digits += this.oneOf("0123456789", "digit");
    }
    return signed(negative, Number(digits));
  }

  /** An integer, of 16 bits unless all five digits count; the place of its sign is given to a check that follows (MM-12). */
  integer(blank: boolean, wide: boolean, check: (value: number, offset: number) => void = () => undefined): number {
    const offset = this.at;
    const negative = this.oneOf("+-", "sign") === "-";
    if (blank) this.skip(" ");
    let digits = "";
    for (let place = 0; place < 5; place += 1) digits += this.oneOf("0123456789", "digit");
    const value = signed(negative, Number(digits));
    if (!wide && (value < -0x8000 || value > 0x7fff)) throw new LineFault({ kind: "integer_range", offset, found: value });
    check(value, offset);
    return value;
  }

  /** The rest of the line is one of these words. */
  word(words: readonly string[], expected: Expected): string {
    const rest = this.text.slice(this.at);
    if (words.includes(rest)) {
      this.at += rest.length;
      return rest;
    }
    const begun = words.find((word) => rest.startsWith(word));
    if (begun !== undefined) throw new LineFault({ kind: "trailing", offset: this.at + begun.length });
    if (words.some((word) => word.startsWith(rest))) this.short(expected);
    this.unexpected(expected);
  }

  /** A device without axes has nothing to read here (MM-16). */
  noAxes(): never {
    if (this.left === 0) this.short("no_axes");
    this.unexpected("no_axes");
  }

  /** Nothing is left over. */
  end(): void {
    if (this.left > 0) throw new LineFault({ kind: "trailing", offset: this.at });
  }

  private short(expected: Expected): never {
    throw new LineFault({ kind: "short", offset: this.text.length, expected });
  }

  private unexpected(expected: Expected): never {
    throw new LineFault({ kind: "unexpected", offset: this.at, found: this.text.charCodeAt(this.at), expected });
  }
}

function signed(negative: boolean, value: number): number {
  return negative ? 0 - value : value; // no -0
}
