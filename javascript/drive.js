// Runs a session on a transport: a socket, a serial port, a pair of streams. The session decides; this has the clock.
import { now } from "./cellwire.js";

const LONGEST = 2_000_000_000; // ms that a timer can wait

/**
 * Runs `session` until `disconnected` is called. `write` sends bytes. `event` has each event, before anything that it leads to is sent.
 * Call `received` with the bytes that arrive.
 */
export function drive(session, { write, event, transmitted }) {
  let timer, running = false;
  function run() {
    if (running) return; // an event whose handler calls the session
    running = true;
    try {
      for (let idle = false; !idle;) {
        idle = true;
        for (let each; (each = session.pollEvent()) !== null; idle = false) event(each);
        for (let bytes; (bytes = session.pollTransmit(now())) !== null; idle = false) {
          const sent = write(bytes);
          if (transmitted) Promise.resolve(sent).then(() => { session.handleTransmitted(now()); run(); });
        }
      }
    } finally {
      running = false;
    }
    clearTimeout(timer);
    const deadline = session.pollTimeout();
    if (deadline !== null) {
      const wait = Math.min(Number(deadline - now()) / 1e6, LONGEST);
      timer = setTimeout(() => { session.handleTimeout(now()); run(); }, Math.max(0, Math.ceil(wait)));
    }
  }
  const after = (act) => { act(); run(); };
  after(() => session.handleConnected(now()));
  return {
    received: (bytes) => after(() => session.handleInput(bytes, now())),
    disconnected() {
      after(() => session.handleDisconnected(now()));
      clearTimeout(timer);
    },
    call: (name, argument) => after(() => session.call(name, argument, now())),
  };
}
