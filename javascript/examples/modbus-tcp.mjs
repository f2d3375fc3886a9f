// Reads registers of a controller over TCP: node modbus-tcp.mjs HOST PORT
import { connect } from "node:net";
import { load } from "cellwire";
import { drive } from "cellwire/drive";

const [host, port] = process.argv.slice(2);
const client = (await load()).session("fanuc-hmi-modbus", "client");
const socket = connect(Number(port), host);
socket.once("connect", () => {
  const driven = drive(client, {
    write: (bytes) => socket.write(bytes),
    event(event) {
      console.log(event.event === "replied" ? `registers ${event.message.registers}` : event);
      if (event.event === "replied" || event.event === "failed") socket.end();
    },
  });
  socket.on("data", driven.received);
  socket.once("close", driven.disconnected);
  driven.call("request", { unit: 1, function: 3, address: 0, quantity: 4 });
});
