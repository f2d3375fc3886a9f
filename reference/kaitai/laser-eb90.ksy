meta:
  id: laser_eb90
  title: Frame of a laser machining robot
doc: |
  One frame, as laser-eb90.md describes it, after unstuffing: of the bytes between flag and tail each 90 90 has become 90. Head,
  flag, tail and check are as on the line. The parameters are the options of section 11.
params:
  - id: flag
    type: str
    -default: separate
    doc: 'separate or first_tag.'
  - id: tail
    type: str
    -default: printed
    doc: 'printed, etx or either.'
  - id: checksum
    type: str
    -default: u8
    doc: 'u8, u16_le or u16_be.'
  - id: checksum_negated
    type: bool
    -default: false
  - id: checksum_with_flag
    type: bool
    -default: false
  - id: byte_order
    type: str
    -default: little
    doc: 'little or big.'
  - id: tags_f32
    type: u1
    -default: 0xf0
  - id: tags_i16
    type: u1
    -default: 0xf1
  - id: tags_u8
    type: u1
    -default: 0xf2
  - id: tags_char
    type: u1
    -default: 0xf3
seq:
  - id: head
    contents: [0xeb, 0x90, 0x82]
  - id: frame_flag
    contents: [0xf0]
    if: flag == "separate"
  - id: payload
    type: payload
    size: len_payload
  - id: tail_mark
    contents: [0x90]
  - id: tail_end
    type: u1
    valid:
      expr: '_ == (tail == "etx" ? 0x83 : 0x82) or (tail == "either" and _ == 0x83)'
  - id: check
    type:
      switch-on: checksum
      cases:
        '"u8"': u1
        '"u16_le"': u2le
        '"u16_be"': u2be
    valid:
      expr: _ == expected_check
instances:
  len_payload:
    value: '_io.size - 3 - (flag == "separate" ? 1 : 0) - 2 - (checksum == "u8" ? 1 : 2)'
  sum:
    value: 'payload.sum + (checksum_with_flag and flag == "separate" ? 0xf0 : 0)'
  expected_check:
    value: '(checksum_negated ? 0x1000000 - sum : sum) & (checksum == "u8" ? 0xff : 0xffff)'
  items:
    value: payload.items
types:
  payload:
    doc: 1 to 512 bytes.
    seq:
      - id: items
        type: item
        repeat: until
        repeat-until: _io.eof
      - id: too_long
        size: 0
        valid:
          expr: _io.size <= 512
    instances:
      summands:
        pos: 0
        type: 'summand(_index == 0 ? 0 : summands[_index - 1].sum)'
        repeat: eos
      sum:
        value: summands.last.sum
  item:
    doc: A tag, a count, and that many values of one type; only the attribute of that type is there.
    meta:
      endian:
        switch-on: _root.byte_order
        cases:
          '"big"': be
          _: le
    seq:
      - id: tag
        type: u1
        valid:
          expr: _ == _root.tags_f32 or _ == _root.tags_i16 or _ == _root.tags_u8 or _ == _root.tags_char
      - id: count
        type: u1
      - id: f32
        type: f4
        repeat: expr
        repeat-expr: count
        if: tag == _root.tags_f32
      - id: i16
        type: s2
        repeat: expr
        repeat-expr: count
        if: tag == _root.tags_i16
      - id: u8
        type: u1
        repeat: expr
        repeat-expr: count
        if: tag == _root.tags_u8
      - id: char
        doc: The byte is the character of the same number. JavaScript's TextDecoder has others for 80h to 9Fh.
        type: str
        size: count
        encoding: ISO-8859-1
        if: tag == _root.tags_char
  summand:
    doc: A byte of the payload, and the sum of the bytes up to it.
    params:
      - id: before
        type: s4
    seq:
      - id: value
        type: u1
    instances:
      sum:
        value: before + value
