meta:
  id: mmacell_proto
  title: Line of the MM&A cell
  endian: le
  encoding: ASCII
doc: |
  One line with its end, as mmacell-proto.md describes it. Every field has a fixed number of characters. The parameters are the
  side that sends the line and the options of section 11; with `sender` central the number of axes follows from the length.
params:
  - id: sender
    type: str
    doc: 'central, robot or platform.'
  - id: itr
    type: bool
    -default: false
  - id: ovrd
    type: bool
    -default: false
  - id: clos
    type: bool
    -default: false
  - id: off
    type: bool
    -default: false
  - id: lone_lf
    type: bool
    -default: false
  - id: blank
    type: bool
    -default: false
  - id: wide_integers
    type: bool
    -default: false
seq:
  - id: request
    type: request
    size: _io.size - len_end
    if: sender == "central"
  - id: answer
    type: answer
    size: _io.size - len_end
    if: sender != "central"
  - id: carriage_return
    contents: [0x0d]
    if: len_end == 2
  - id: line_feed
    contents: [0x0a]
instances:
  before_last:
    pos: _io.size - 2
    type: u1
  len_end:
    value: 'lone_lf and before_last != 0x0d ? 1 : 2'
  command:
    value: 'request.word == "ITR" ? "STP" : request.word'
    if: sender == "central"
  on:
    value: request.rest == "ON"
    if: sender == "central" and request.word == "SRV"
  percent:
    value: request.number.value
    if: sender == "central" and request.word == "OVR"
  camera:
    value: request.number.value
    if: sender == "central" and request.word == "ACQ"
  gripper:
    value: request.number.value
    if: sender == "central" and request.word == "HND"
  open:
    value: request.rest == "OPEN"
    if: sender == "central" and request.word == "HND"
  mode:
    value: 'request.mode == "A" ? "absolute" : "relative"'
    if: sender == "central" and request.word == "MOV"
  reply:
    value: 'answer.word == "ER" ? "error" : answer.is_status ? "status" : "ok"'
    if: sender != "central"
  moving:
    value: answer.moving.character == "T"
    if: sender != "central" and answer.is_status
  servo:
    value: answer.servo.character == "T"
    if: sender != "central" and answer.is_status
  override:
    value: answer.percent.value
    if: sender != "central" and answer.is_status
  error:
    value: answer.error.value
    if: sender != "central" and (answer.is_status or answer.word == "ER")
  axes:
    value: 'sender == "central" ? request.axes : answer.axes'
    doc: Millimetres and radians.
types:
  request:
    seq:
      - id: word
        type: str
        size: 3
        valid:
          expr: '_ == "STA" or _ == "SRV" or _ == "OVR" or _ == "MOV" or _ == "STP" or _ == "RST" or _ == "CLO" or _ == "ACQ" or _ == "HND" or (_ == "ITR" and _root.itr)'
      - id: letter_d
        contents: D
        if: word == "OVR" and _root.ovrd and fourth == 0x44
      - id: mode
        type: str
        size: 1
        valid:
          any-of: ['"A"', '"R"']
        if: word == "MOV"
      - id: axes
        type: 'axis(num_axes == 2 or _index == 3)'
        repeat: expr
        repeat-expr: num_axes
        if: word == "MOV"
      - id: number
        type: integer
        if: word == "OVR" or word == "ACQ" or word == "HND"
      - id: percent_check
        size: 0
        valid:
          expr: word != "OVR" or (number.value >= 0 and number.value <= 100)
      - id: rest
        type: str
        size-eos: true
        valid:
          expr: 'word == "SRV" ? (_ == "ON" or _ == "OF" or (_ == "OFF" and _root.off)) : word == "HND" ? (_ == "OPEN" or _ == "CLOSE" or (_ == "CLOS" and _root.clos)) : _ == ""'
    instances:
      fourth:
        pos: 3
        type: u1
      num_axes:
        value: '_io.size - 4 >= 32 ? 4 : 2'
  answer:
    seq:
      - id: word
        type: str
        size: 2
        valid:
          any-of: ['"OK"', '"ER"']
      - id: moving
        type: flag
        if: is_status
      - id: axes
        type: 'axis(_root.sender == "platform" or _index == 3)'
        repeat: expr
        repeat-expr: '_root.sender == "platform" ? 2 : 4'
        if: is_status
      - id: servo
        type: flag
        if: is_status
      - id: percent
        type: integer
        if: is_status
      - id: error
        type: integer
        if: is_status or word == "ER"
      - id: end
        size: 0
        valid:
          expr: _io.eof and (not is_status or (percent.value >= 0 and percent.value <= 100)) and (word != "ER" or error.value != 0)
    instances:
      is_status:
        value: word == "OK" and _io.size > 2
  axis:
    params:
      - id: is_angle
        type: bool
    seq:
      - id: sign
        type: sign
      - id: whole
        type: 'digit(_index == 0 ? 0 : whole[_index - 1].value)'
        repeat: expr
        repeat-expr: 'is_angle ? 2 : 3'
      - id: point
        contents: '.'
      - id: fraction
        type: 'digit(_index == 0 ? whole.last.value : fraction[_index - 1].value)'
        repeat: expr
        repeat-expr: 'is_angle ? 4 : 3'
    instances:
      units:
        value: 'sign.is_minus ? 0 - fraction.last.value : fraction.last.value'
        doc: Of the last digit, 1 µm or 0.1 mrad.
      value:
        value: 'units / (is_angle ? 10000.0 : 1000.0)'
  integer:
    seq:
      - id: sign
        type: sign
      - id: blank
        contents: ' '
        if: _root.blank and next == 0x20
      - id: digits
        type: 'digit(_index == 0 ? 0 : digits[_index - 1].value)'
        repeat: expr
        repeat-expr: 5
      - id: range
        size: 0
        valid:
          expr: _root.wide_integers or (value >= -32768 and value <= 32767)
    instances:
      next:
        pos: _io.pos
        type: u1
      value:
        value: 'sign.is_minus ? 0 - digits.last.value : digits.last.value'
  sign:
    seq:
      - id: character
        type: str
        size: 1
        valid:
          any-of: ['"+"', '"-"']
    instances:
      is_minus:
        value: character == "-"
  flag:
    seq:
      - id: character
        type: str
        size: 1
        valid:
          any-of: ['"T"', '"F"']
  digit:
    params:
      - id: before
        type: s4
    seq:
      - id: character
        type: u1
        valid:
          min: 0x30
          max: 0x39
    instances:
      value:
        value: before * 10 + character - 0x30
