meta:
  id: fanuc_hmi_modbus
  title: Modbus frame, TCP or RTU
  endian: be
doc: |
  One frame, as fanuc-hmi-modbus.md describes it. `and` and `or` of function 22 are and_mask and or_mask.
params:
  - id: sender
    type: str
    doc: 'client or server.'
  - id: framing
    type: str
    -default: tcp
    doc: 'tcp or rtu.'
seq:
  - id: transaction
    type: u2
    if: is_tcp
  - id: protocol
    contents: [0, 0]
    if: is_tcp
  - id: length
    type: u2
    valid:
      min: 2
      max: 254
    if: is_tcp
  - id: unit
    type: u1
  - id: code
    type: u1
    valid:
      expr: 'is_request ? _ >= 1 and _ <= 127 : _ != 0 and _ != 128'
  - id: exception
    type: u1
    if: is_exception
  - id: address
    type: u2
    if: is_typed and (is_request or is_write) or is_request and code == 24
  - id: exception_status
    type: u1
    if: code == 7 and not is_request
  - id: log_count
    type: u1
    valid:
      min: 6
      max: 70
    if: code == 12 and not is_request
  - id: event_status
    type: u2
    if: is_events
  - id: events
    type: u2
    if: is_events
  - id: messages
    type: u2
    if: is_events and code == 12
  - id: log
    type: u1
    repeat: expr
    repeat-expr: log_count - 6
    if: is_events and code == 12
  - id: len_runs
    type: u1
    valid:
      min: 1
    if: is_files
  - id: runs
    type: 'runs(code == 20 ? 245 : 251)'
    size: len_runs
    if: is_files
  - id: queue_bytes
    type: u2
    if: code == 24 and not is_request
  - id: queue_count
    type: u2
    valid:
      expr: _ <= 31 and queue_bytes == 2 + 2 * _
    if: code == 24 and not is_request
  - id: subfunction
    type: u2
    if: code == 8
  - id: mei
    type: u1
    if: is_identification
  - id: category
    type: u1
    if: is_identification
  - id: object
    type: u1
    if: is_identification and is_request
  - id: conformity
    type: u1
    if: is_identification and not is_request
  - id: more_follows
    type: u1
    valid:
      any-of: [0, 0xff]
    if: is_identification and not is_request
  - id: next
    type: u1
    if: is_identification and not is_request
  - id: object_count
    type: u1
    if: is_identification and not is_request
  - id: objects
    type: device_object
    repeat: expr
    repeat-expr: object_count
    if: is_identification and not is_request
  - id: quantity
    type: u2
    valid:
      expr: _ >= 1 and _ <= max_quantity
    if: is_request and is_read or is_run
  - id: write_address
    type: u2
    if: is_request and code == 23
  - id: write_quantity
    type: u2
    valid:
      min: 1
      max: 121
    if: is_request and code == 23
  - id: byte_count
    type: u1
    valid:
      expr: 'is_request ? _ == count_of_request : _ >= 1 and _ <= 250 and (code <= 2 or code == 17 or (_ & 1) == 0)'
    if: 'is_request ? is_run or code == 23 : is_read or code == 17'
  - id: id
    type: u1
    repeat: expr
    repeat-expr: byte_count
    if: code == 17 and not is_request
  - id: value
    type:
      switch-on: code
      cases:
        5: coil
        6: register
    if: code == 5 or code == 6
  - id: and_mask
    type: u2
    if: code == 22
  - id: or_mask
    type: u2
    if: code == 22
  - id: values
    type:
      switch-on: code
      cases:
        8: register
        15: bit
        16: register
        23: register
    repeat: expr
    repeat-expr: 'code == 8 ? words_of_diagnostic : code == 23 ? write_quantity : quantity'
    if: is_request and (is_run or code == 23) or code == 8
  - id: bits
    type: b1le
    repeat: expr
    repeat-expr: byte_count * 8
    if: not is_request and code <= 2
  - id: registers
    type: u2
    repeat: expr
    repeat-expr: 'code == 24 ? queue_count : byte_count / 2'
    if: not is_request and (is_read and code > 2 or code == 24)
  - id: data
    type: u1
    repeat: expr
    repeat-expr: end_of_pdu - data_from
    if: is_raw and not is_exception
  - id: end
    size: 0
    valid:
      expr: _io.pos == end_of_pdu
  - id: crc
    type: u2le
    valid:
      expr: _ == crc_steps.last.after
    if: not is_tcp
instances:
  is_tcp:
    value: framing == "tcp"
  is_request:
    value: sender == "client"
  is_exception:
    value: not is_request and code > 128
  function:
    value: 'is_exception ? code - 128 : code'
  is_read:
    value: code >= 1 and code <= 4 or code == 23
  is_run:
    value: code == 15 or code == 16
  is_write:
    value: code == 5 or code == 6 or code == 22 or is_run
  is_typed:
    value: is_read or is_write
  is_identification:
    value: code == 43 and end_of_pdu > data_from and mei_type == 14
  mei_type:
    pos: data_from
    type: u1
  more:
    value: more_follows == 0xff
  is_raw:
    value: not is_typed and code != 8 and not is_bare and not is_files and code != 24 and not is_identification
  is_bare:
    value: code == 7 or code == 11 or code == 12 or code == 17
  is_events:
    value: (code == 11 or code == 12) and not is_request
  is_files:
    value: code == 20 or code == 21
  status:
    value: 'code == 7 ? exception_status : event_status'
  ranges:
    value: runs.runs
  records:
    value: runs.runs
  contents:
    value: runs.runs
  words_of_diagnostic:
    value: 'end_of_pdu - data_from < 4 ? 1 : (end_of_pdu - data_from - 2) / 2'
  max_quantity:
    value: 'code <= 2 ? 2000 : code == 15 ? 1968 : code == 16 ? 123 : 125'
  count_of_request:
    value: 'code == 15 ? (quantity + 7) / 8 : 2 * (code == 23 ? write_quantity : quantity)'
  data_from:
    value: 'is_tcp ? 8 : 2'
  end_of_pdu:
    value: 'is_tcp ? 6 + length : _io.size - 2'
  crc_steps:
    pos: 0
    type: 'crc_step(_index == 0 ? 0xffff : crc_steps[_index - 1].after)'
    repeat: expr
    repeat-expr: _io.size - 2
types:
  runs:
    params:
      - id: most
        type: s4
    seq:
      - id: runs
        type: 'run(_index == 0 ? most : runs[_index - 1].left)'
        repeat: eos
  run:
    doc: Registers of a file; in a reply to function 20 with a length, without file and record.
    params:
      - id: room
        type: s4
    seq:
      - id: length
        type: u1
        valid:
          expr: (_ & 1) == 1
        if: is_contents
      - id: reference_type
        type: u1
        valid: 6
      - id: file
        type: u2
        if: not is_contents
      - id: record
        type: u2
        if: not is_contents
      - id: quantity
        type: u2
        if: not is_contents
      - id: values
        type: u2
        repeat: expr
        repeat-expr: count
        if: is_contents or _root.code == 21
      - id: end
        size: 0
        valid:
          expr: count >= 1 and left >= 0
    instances:
      is_contents:
        value: _root.code == 20 and not _root.is_request
      count:
        value: 'is_contents ? (length - 1) / 2 : quantity'
      left:
        value: 'room - 2 * count - (_root.code == 20 ? 2 : 7)'
      value:
        value: values
        if: is_contents
  device_object:
    seq:
      - id: id
        type: u1
      - id: len_text
        type: u1
      - id: text
        type: str
        size: len_text
        encoding: ISO-8859-1
  coil:
    seq:
      - id: word
        type: u2
        valid:
          any-of: [0, 0xff00]
    instances:
      value:
        value: word == 0xff00
  register:
    seq:
      - id: value
        type: u2
  bit:
    seq:
      - id: value
        type: b1le
  crc_step:
    doc: A byte of unit and PDU, and the CRC after it.
    params:
      - id: before
        type: s4
    seq:
      - id: byte
        type: u1
    instances:
      s0:
        value: before ^ byte
      s1:
        value: (s0 >> 1) ^ (s0 & 1) * 0xa001
      s2:
        value: (s1 >> 1) ^ (s1 & 1) * 0xa001
      s3:
        value: (s2 >> 1) ^ (s2 & 1) * 0xa001
      s4:
        value: (s3 >> 1) ^ (s3 & 1) * 0xa001
      s5:
        value: (s4 >> 1) ^ (s4 & 1) * 0xa001
      s6:
        value: (s5 >> 1) ^ (s5 & 1) * 0xa001
      s7:
        value: (s6 >> 1) ^ (s6 & 1) * 0xa001
      after:
        value: (s7 >> 1) ^ (s7 & 1) * 0xa001
