// A serial line as a stream: Node's own would need a native package.
'use strict'
const { execFileSync } = require('child_process')
const { Duplex } = require('stream')
const fs = require('fs')

exports.openLine = path => {
  const fd = fs.openSync(path, fs.constants.O_RDWR | fs.constants.O_NONBLOCK | fs.constants.O_NOCTTY)
  execFileSync('stty', ['-F', path, 'raw', '-echo'])
  const line = new Duplex({
    read () {},
    write (chunk, _, done) { fs.write(fd, chunk, done) }
  })
  const buffer = Buffer.alloc(4096)
  const receive = () => {
    try {
      const length = fs.readSync(fd, buffer)
      if (length > 0) line.push(Buffer.from(buffer.subarray(0, length)))
    } catch (error) {
      if (error.code !== 'EAGAIN') return line.push(null) // the other end is gone
    }
    setTimeout(receive, 1)
  }
  process.nextTick(() => line.emit('open'))
  receive()
  return line
}
