import { load, now } from "cellwire";
import { drive } from "cellwire/drive";

const cellwire = await load();
for (const item of cellwire.decode("isra-ball", Uint8Array.of(8))) {
  if (item.error) console.log(item.error.kind);
  else if ("force" in item.message) console.log(item.message.force[0] + 1);
}
// @ts-expect-error a link that is none
cellwire.decode("israball", Uint8Array.of());
// @ts-expect-error a side of another link
cellwire.decoder("mmacell-proto", { from: "client" });
cellwire.encode("mmacell-proto", { command: "OVR", percent: 50 }, { from: "central" });

const client = cellwire.session("fanuc-hmi-modbus", "client", { framing: "rtu", timeout: 200_000_000n });
client.call("request", { unit: 1, function: 3, address: 0, quantity: 2 }, now());
// @ts-expect-error a call of another end
client.call("measure", null, now());
// @ts-expect-error a field that there is not
cellwire.session("isra-ball", "host", { perod: 1 });
const host = cellwire.session("isra-ball", "host", { period: 30_000_000 });
const driven = drive(host, {
  write: (bytes) => bytes.length,
  event(event) {
    if (event.event === "new" && "keys" in event.message) console.log(event.message.keys);
    // @ts-expect-error an event of another end
    if (event.event === "pose") console.log();
  },
});
driven.received(Uint8Array.of(5));
