/** Codecs and sessions of all links. */

export { Refused } from "./check.js";
export type { Item, ItemReader } from "./stream.js";

export * as israBall from "./isra-ball.js";
export * as val2Viewer from "./val2-viewer.js";
export * as laserEb90 from "./laser-eb90.js";
export * as mmacellProto from "./mmacell-proto.js";
export * as kawasakiMsg from "./kawasaki-msg.js";
export * as val2Alter from "./val2-alter.js";
export { Dialect } from "./kawasaki-dialect.js";
export { AlterDecoder } from "./alter-decoder.js";
export * as fanucHmiModbus from "./fanuc-hmi-modbus.js";
export * as modbusPdu from "./modbus-pdu.js";
export * as modbusValues from "./modbus-values.js";
export * as fanucLs from "./fanuc-ls.js";
export { readDocument, readProgram, textOf } from "./ls-read.js";
export { writeProgram } from "./ls-write.js";

export { NEVER, type Session } from "./sessions/session.js";
export { Ball } from "./sessions/ball.js";
export { BallHost } from "./sessions/ball-host.js";
export { ViewerHost } from "./sessions/viewer-host.js";
export { Workstation } from "./sessions/workstation.js";
export { LaserHost } from "./sessions/laser-host.js";
export { LaserController } from "./sessions/laser-controller.js";
export { MmaCentral } from "./sessions/mma-central.js";
export { MmaDevice } from "./sessions/mma-device.js";
export { ModbusClient } from "./sessions/modbus-client.js";
export { ModbusServer } from "./sessions/modbus-server.js";
export { MemoryTables, type ModbusTables } from "./sessions/modbus-tables.js";
export { AlterController } from "./sessions/alter-controller.js";
export { AlterHost } from "./sessions/alter-host.js";
export { KawasakiPc } from "./sessions/kawasaki-pc.js";
export { KawasakiRobot } from "./sessions/kawasaki-robot.js";
