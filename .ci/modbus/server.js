// jsmodbus's own server: tcp on a free port, which it prints, or rtu on the line of argv[3].
'use strict'
const net = require('net')
const modbus = require('jsmodbus')
const { openLine } = require('./line')

const bits = value => {
  const buffer = Buffer.alloc(400)
  for (let n = 0; n < 3200; n++) if (value(n)) buffer[n >> 3] |= 1 << (n & 7)
  return buffer
}
const words = value => {
  const buffer = Buffer.alloc(6400)
  for (let n = 0; n < 3200; n++) buffer.writeUInt16BE(value(n), 2 * n)
  return buffer
}
const tables = {
  coils: bits(n => n % 7 === 0),
  discrete: bits(n => n % 3 === 0),
  holding: words(n => n),
  input: words(n => 60000 + n)
}

const [kind, path] = process.argv.slice(2)
let server
if (kind === 'rtu') {
  server = new modbus.server.RTU(openLine(path), tables)
  console.log('ready')
} else {
  const listener = new net.Server()
  server = new modbus.server.TCP(listener, tables)
  listener.listen(0, '127.0.0.1', () => console.log(listener.address().port))
}
