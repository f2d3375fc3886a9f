// jsmodbus reads and writes every table of the simulated FANUC controller, over TCP or a serial line.
'use strict'
const net = require('net')
const assert = require('assert')
const modbus = require('jsmodbus')

const { openLine } = require('./line')

const [kind, address] = process.argv.slice(2)
const socket = kind === 'rtu' ? openLine(address) : new net.Socket()
const client = kind === 'rtu' ? new modbus.client.RTU(socket, 1, 5000) : new modbus.client.TCP(socket, 1, 2000)
let checks = 0

const same = (found, expected, what) => {
  checks += 1
  assert.deepStrictEqual(found, expected, what)
}
const values = async (request, count) => (await request).response.body.valuesAsArray.slice(0, count)
const exception = async (request, code, what) => {
  try {
    await request
  } catch (error) {
    return same(error.response && error.response.body.code, code, what)
  }
  assert.fail(`${what}: no exception`)
}
const range = (first, count, value) => Array.from({ length: count }, (_, i) => value(first + 1 + i))
const read = {
  discrete: (a, n) => client.readDiscreteInputs(a, n),
  coils: (a, n) => client.readCoils(a, n),
  input: (a, n) => client.readInputRegisters(a, n),
  holding: (a, n) => client.readHoldingRegisters(a, n)
}

const tables = [
  ['discrete', 28000, 2000, n => (n % 3 === 0 ? 1 : 0)],
  ['coils', 30000, 2000, () => 0],
  ['input', 4000, 125, n => n],
  ['holding', 16448, 125, n => (n <= 16384 ? n : 0)]
]

const main = async () => {
  for (const [name, end, step, value] of tables) {
    // On a line a whole table takes long: a seventh of it.
    for (let first = name === 'holding' ? 37 : 0; first < end; first += kind === 'rtu' ? 7 * step : step) {
      const count = Math.min(step, end - first)
      same(await values(read[name](first, count), count), range(first, count, value), `${name} ${first}`)
    }
    await exception(read[name](end, 1), 2, `after the end of ${name}`)
    await exception(read[name](end - 1, 2), 2, `across the end of ${name}`)
  }
  const pattern = Array.from({ length: 1968 }, (_, i) => i % 5 === 0)
  // 123 registers are the most that a write may have, but above 120 jsmodbus announces fewer bytes than it sends.
  const numbers = Array.from({ length: 120 }, (_, i) => 65535 - 3 * i)
  await client.writeSingleCoil(29999, true)
  same(await values(client.readCoils(29998, 2), 2), [0, 1], 'one coil')
  await client.writeMultipleCoils(11, pattern)
  same(await values(client.readCoils(11, 1968), 1968), pattern.map(Number), '1968 coils')
  await client.writeSingleRegister(16447, 0xABCD)
  same(await values(client.readHoldingRegisters(16447, 1)), [0xABCD], 'one register')
  await client.writeMultipleRegisters(1000, numbers)
  same(await values(client.readHoldingRegisters(1000, 120)), numbers, '120 registers')
  await exception(client.writeSingleCoil(30000, true), 2, 'coil after the table')
  await exception(client.writeSingleRegister(16448, 1), 2, 'register after the table')
  await exception(client.writeMultipleRegisters(16447, [1, 2]), 2, 'registers across the end')
  const telemetry = await values(client.readHoldingRegisters(0, 37))
  same([telemetry.length, telemetry[2]], [37, 100], 'telemetry')
  if (kind === 'rtu') return end()
  // Every request at once: jsmodbus sends them in a row and matches the replies.
  const many = await Promise.all(range(100, 50, n => values(client.readInputRegisters(n - 1, 1))))
  same(many.map(([n]) => n), range(100, 50, n => n), '50 requests at once')
  end()
}
const end = () => {
  console.log(`jsmodbus, ${kind}: ${checks} checks`)
  process.exit(0)
}
const fail = error => {
  console.error(error)
  process.exit(1)
}

socket.on('error', fail)
if (kind === 'rtu') {
  socket.on('open', () => main().catch(fail))
} else {
  const [host, port] = address.split(':')
  socket.on('connect', () => main().catch(fail))
  socket.connect({ host, port })
}
