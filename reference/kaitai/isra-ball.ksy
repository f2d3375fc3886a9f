meta:
  id: isra_ball
  title: Packet of the ISRA Robot Command Teach Ball
  endian: le
doc: |
  One packet, as isra-ball.md describes it. There is no stuffing: these are the bytes on the line. The poll is the single
  byte 05 and is not described here. Of packets with another number of data bytes than 8 only the envelope is known.
seq:
  - id: len_data
    type: u1
    doc: n, the number of data bytes.
  - id: minus_len_data
    type: u1
    valid:
      expr: _ == ((256 - len_data) & 0xff)
  - id: xor_len_data
    type: u1
    valid:
      expr: _ == (len_data ^ 0x55)
  - id: summands
    type: 'summand(_index == 0 ? len_data : summands[_index - 1].sum)'
    repeat: expr
    repeat-expr: len_data
  - id: checksum
    type: u1
    valid:
      expr: '(((len_data == 0 ? 0 : summands.last.sum) + _) & 0xff) == 0'
instances:
  data:
    pos: 3
    type: u1
    repeat: expr
    repeat-expr: len_data
  known:
    pos: 3
    type: measurement
    if: len_data == 8
  sensor_type:
    value: known.id >> 4 & 7
    if: len_data == 8
    doc: Sensor type, 0..=7.
  sensor:
    value: known.id & 7
    if: len_data == 8
    doc: Sensor number, 0..=7.
  status:
    value: '(known.id & 0x88) == 0 ? "fresh" : (known.id & 0x88) == 0x80 ? "old" : "reserved"'
    if: len_data == 8
    doc: Bit 7 is ab1, bit 3 is ab0.
  force:
    value: known.force
    if: len_data == 8
    doc: X, Y, Z in units of the sensor.
  moment:
    value: known.moment
    if: len_data == 8
    doc: About X, Y, Z in units of the sensor.
  keys:
    value: known.keys
    if: len_data == 8
    doc: Bit k - 1 is key k, 1 is down.
types:
  measurement:
    seq:
      - id: id
        type: u1
      - id: force
        type: s1
        repeat: expr
        repeat-expr: 3
      - id: moment
        type: s1
        repeat: expr
        repeat-expr: 3
      - id: keys
        type: u1
  summand:
    doc: A data byte, and the sum of n and the data bytes up to it.
    params:
      - id: before
        type: s4
    seq:
      - id: value
        type: u1
    instances:
      sum:
        value: before + value
