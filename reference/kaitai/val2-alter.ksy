meta:
  id: val2_alter
  title: Messages of VAL II ALTER
  endian: le
doc: |
  The data of one frame after unstuffing, and its checksum, as val2-alter.md describes them. Before it, the reader removes the
  start mark (DLE DLE STX) and the end mark (DLE ETX), and makes one DLE of each doubled one, also of a doubled checksum.
params:
  - id: sender
    type: str
    doc: robot or host.
    -default: robot
  - id: negated_sum
    type: bool
    doc: The checksum is the two's complement of the sum.
    -default: false
  - id: ignore_spare_select
    type: bool
    doc: Bits 6 and 7 of a select byte are read as 0.
    -default: false
seq:
  - id: body
    size: len_data
    type:
      switch-on: kind
      cases:
        '"start"': start
        '"start_reply"': start_reply
        '"motion"': motion
        '"end"': end
        '"reply"': host_reply
  - id: checksum
    type: u1
    valid:
      expr: '_ == ((negated_sum ? 256 - (summands.last.sum & 0xff) : summands.last.sum) & 0xff)'
instances:
  len_data:
    value: _io.size - 1
  summands:
    pos: 0
    type: 'summand(_index == 0 ? 0 : summands[_index - 1].sum)'
    repeat: expr
    repeat-expr: len_data
  first:
    pos: 0
    type: u1
    valid:
      expr: 'sender != "robot" or len_data > 0 and ((_ | 0x87) == 0xa7 or (_ & 0x98) == 0x80)'
    doc: The control byte (1mm00eee, bit 7 may be clear in a start message), the answer to a start message, or the exception code.
  mm:
    value: first >> 5 & 3
  kind:
    value: 'sender == "robot" ? (mm == 1 ? "start" : mm == 3 ? "end" : "motion") : len_data == 1 ? "start_reply" : "reply"'
  error:
    value: first & 7
    doc: What was wrong with the last answer of the host, 0..=7.
  marked:
    value: (first & 0x80) != 0
  phase:
    value: 'mm == 2 ? "interrupted" : "running"'
  reply:
    value: 'first == 0 ? "accept" : first == 1 ? "repeat" : "refuse"'
  mode:
    value: body.as<start>.mode
    if: kind == "start"
  data:
    value: body.as<start>.data
    if: kind == "start"
    doc: The data list of the ALTER instruction.
  segment_status:
    value: body.as<motion>.segment_status
    if: kind == "motion"
  segment:
    value: body.as<motion>.segment
    if: kind == "motion"
  percent:
    value: body.as<motion>.percent
    if: kind == "motion"
    doc: 16384 is 100 %.
  transform:
    value: body.as<motion>.transform
    if: kind == "motion" and len_data == 30
    doc: Columns n, o, a (16384 is 1.0) and p (1/32 mm).
  exception:
    value: first
    if: kind == "reply"
  values:
    value: body.as<host_reply>.values
    if: kind == "reply"
    doc: X, Y, Z in 1/32 mm, RX, RY, RZ in 360/65536 degrees.
types:
  summand:
    doc: A data byte, and the sum of the data bytes up to it.
    params:
      - id: before
        type: s4
    seq:
      - id: value
        type: u1
    instances:
      sum:
        value: before + value
  start:
    seq:
      - id: control
        type: u1
      - id: mode
        type: u1
        valid:
          expr: _io.size % 2 == 0 and _io.size <= 30
      - id: data
        type: s2
        repeat: eos
  motion:
    seq:
      - id: control
        type: u1
      - id: segment_status
        type: u1
        valid:
          expr: _io.size == 6 or _io.size == 30
      - id: segment
        type: u2
      - id: percent
        type: u2
      - id: transform
        type: s2
        repeat: eos
  end:
    seq:
      - id: control
        type: u1
        valid:
          expr: _io.size == 1 or _io.size == 6 or _io.size == 30
  start_reply:
    seq:
      - id: answer
        type: u1
        valid:
          any-of: [0x00, 0x01, 0xff]
  host_reply:
    seq:
      - id: exception
        type: u1
      - id: select
        type: u1
        valid:
          expr: (_ < 64 or _root.ignore_spare_select) and _io.size == 2 + 2 * count
      - id: words
        type: 'word((select >> _index & 1) != 0)'
        repeat: expr
        repeat-expr: 6
    instances:
      count:
        value: '(select & 1) + (select >> 1 & 1) + (select >> 2 & 1) + (select >> 3 & 1) + (select >> 4 & 1) + (select >> 5 & 1)'
      values:
        value: '[words[0].value, words[1].value, words[2].value, words[3].value, words[4].value, words[5].value]'
  word:
    params:
      - id: is_selected
        type: bool
    seq:
      - id: word
        type: s2
        if: is_selected
    instances:
      value:
        value: word
        if: is_selected
