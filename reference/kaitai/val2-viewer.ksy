meta:
  id: val2_viewer
  title: Pose for the graphics workstation, one line of text
  encoding: ASCII
doc: |
  One line, as val2-viewer.md describes it. There is no stuffing: these are the bytes on the line. The request is the single
  byte 05 and is not described here.
seq:
  - id: head
    contents: $POSE,
  - id: count_text
    type: str
    terminator: 0x2c
    valid:
      expr: _.to_i.to_s == _ and _.to_i >= 0 and _.to_i <= 65535
  - id: words
    type: word
    repeat: expr
    repeat-expr: 11
  - id: last_word
    type: str
    terminator: 0x2a
    valid:
      expr: _.to_i.to_s == _ and _.to_i >= -32768 and _.to_i <= 32767
  - id: checksum_high
    type: u1
    valid:
      expr: '_ == (xor >> 4) + ((xor >> 4) < 10 ? 0x30 : 0x37)'
  - id: checksum_low
    type: u1
    valid:
      expr: '_ == (xor & 15) + ((xor & 15) < 10 ? 0x30 : 0x37)'
  - id: line_end
    contents: [0x0d, 0x0a]
instances:
  count:
    value: count_text.to_i
    doc: Counts the packets of the host.
  pose:
    value: '[words[0].value, words[1].value, words[2].value, words[3].value, words[4].value, words[5].value,
      words[6].value, words[7].value, words[8].value, words[9].value, words[10].value, last_word.to_i]'
    doc: Columns n, o, a (16384 is 1.0) and p (1/32 mm).
  summed:
    pos: 1
    terminator: 0x2a
    type: summands
  xor:
    value: summed.bytes.last.xor
types:
  word:
    seq:
      - id: text
        type: str
        terminator: 0x2c
        valid:
          expr: _.to_i.to_s == _ and _.to_i >= -32768 and _.to_i <= 32767
    instances:
      value:
        value: text.to_i
  summands:
    seq:
      - id: bytes
        type: 'summand(_index == 0 ? 0 : bytes[_index - 1].xor)'
        repeat: eos
  summand:
    doc: A byte between $ and *, and the XOR of these bytes up to it.
    params:
      - id: before
        type: s4
    seq:
      - id: value
        type: u1
    instances:
      xor:
        value: before ^ value
