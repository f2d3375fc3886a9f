; What is received: strings of up to 255 bytes, a message anywhere in them, also in two.

.PROGRAM cw.unpack (.i)
  $x.piece = $x.buf[.i]
  WHILE LEN ($x.piece) > 0 DO
    .room = 255 - LEN ($x.in)
    IF LEN ($x.piece) > .room THEN
      $x.in = $x.in + $LEFT ($x.piece, .room)
      $x.piece = $MID ($x.piece, .room + 1)
    ELSE
      $x.in = $x.in + $x.piece
      $x.piece = ""
    END
    DO
      CALL cw.find (.found)
    UNTIL NOT .found
  END
.END

; Takes the next message out of $x.in, or what is none.
.PROGRAM cw.find (.found)
  .found = FALSE
  IF $x.in == "" THEN
    RETURN
  END
  .to = INSTR ($x.in, ">")
  IF .to == 0 OR $LEFT ($x.in, 1) <> "<" THEN
    CALL cw.none (.found)
    RETURN
  END
  .found = TRUE
  $x.m = $MID ($x.in, 2, .to - 2)
  IF .to < LEN ($x.in) THEN
    $x.in = $MID ($x.in, .to + 1)
  ELSE
    $x.in = ""
  END
  .again = INSTR ($x.m, "<")
  IF .again > 0 THEN
    ; The message before has no end
    CALL cw.corrupt
    $x.in = $MID ($x.m, .again) + ">" + $x.in
    RETURN
  END
  CALL cw.parse
.END

; $x.in does not begin with a whole message: its end may come, or it is none up to the next mark.
.PROGRAM cw.none (.found)
  .begin = INSTR ($x.in, "<")
  IF .begin == 1 THEN
    .$rest = $MID ($x.in, 2)
    .begin = INSTR (.$rest, "<")
    IF .begin == 0 AND LEN ($x.in) < 255 THEN
      RETURN
    END
    IF .begin > 0 THEN
      .begin = .begin + 1
    END
  END
  CALL cw.corrupt
  IF .begin == 0 THEN
    $x.in = ""
    RETURN
  END
  $x.in = $MID ($x.in, .begin)
  .found = TRUE
.END

; Bytes that are no message may have been a job.
.PROGRAM cw.corrupt ()
  x.answered = TRUE
  CALL cw.say ("corrupt", 0, 0)
  CALL cw.failed
.END

; A message that should have been a job was none: jobs are missing from here on, and what follows in the packet is destroyed.
.PROGRAM cw.failed ()
  IF x.stage == 1 THEN
    x.gap = 1
  END
.END

; $x.m is name$length#data#, between the marks.
.PROGRAM cw.parse ()
  .mark = INSTR ($x.m, "#")
  .len = LEN ($x.m) - .mark - 1
  IF .mark == 0 OR .len < 0 THEN
    CALL cw.corrupt
    RETURN
  END
  $x.d = $MID ($x.m, .mark + 1)
  $x.h = $LEFT ($x.m, .mark - 1)
  .sep = INSTR ($x.h, "$")
  IF INSTR ($x.d, "#") <> .len + 1 OR .sep < 2 THEN
    CALL cw.corrupt
    RETURN
  END
  $x.d = $LEFT ($x.d, .len)
  $x.name = $LEFT ($x.h, .sep - 1)
  $x.h = $MID ($x.h, .sep + 1)
  IF $x.h <> $ENCODE (/L, .len) THEN
    CALL cw.length (.len, .ok)
    IF NOT .ok THEN
      CALL cw.corrupt
      RETURN
    END
  END
  x.answered = TRUE
  CALL cw.message
.END

; The length, where it is not written as we would: the header may have more fields before it, and blanks around it.
.PROGRAM cw.length (.len, .ok)
  .sep = INSTR ($x.h, "$")
  WHILE .sep > 0 DO
    $x.h = $MID ($x.h, .sep + 1)
    .sep = INSTR ($x.h, "$")
  END
  CALL cw.number ($x.h, .v, .ok)
  .ok = .ok AND (.v == .len)
.END

; The fields of $x.d: x.n of them in $x.f, their values in x.v; x.bad is the first that is no number. One may be empty from
; .must + 1 on: it counts as 0.
.PROGRAM cw.split (.must)
  x.n = 0
  x.bad = 0
  IF $x.d == "" THEN
    RETURN
  END
  DO
    x.n = x.n + 1
    .sep = INSTR ($x.d, "$")
    IF .sep > 0 THEN
      $x.f[x.n] = $LEFT ($x.d, .sep - 1)
      $x.d = $MID ($x.d, .sep + 1)
    ELSE
      $x.f[x.n] = $x.d
    END
    x.v[x.n] = VAL ($x.f[x.n])
    IF $x.f[x.n] <> $ENCODE (/L, x.v[x.n]) THEN
      CALL cw.odd (.must)
    END
  UNTIL .sep == 0
.END

; A field that is not written as we would: blanks, zeros, nothing, or no number.
.PROGRAM cw.odd (.must)
  IF $x.f[x.n] == "" AND x.n > .must THEN
    x.v[x.n] = 0
    RETURN
  END
  CALL cw.number ($x.f[x.n], x.v[x.n], .ok)
  IF NOT .ok AND x.bad == 0 THEN
    x.bad = x.n
  END
.END

; A whole number of at most seven digits, with blanks around it.
.PROGRAM cw.number (.$t, .v, .ok)
  .ok = FALSE
  .v = 0
  .sign = 1
  CALL cw.trim (.$t)
  IF $LEFT (.$t, 1) == "-" THEN
    .sign = -1
    .$t = $MID (.$t, 2)
  END
  IF .$t == "" THEN
    RETURN
  END
  FOR .i = 1 TO LEN (.$t)
    .$c = $MID (.$t, .i, 1)
    .digit = INSTR ("0123456789", .$c)
    IF .digit == 0 OR .v > 999999 THEN
      RETURN
    END
    .v = .v * 10 + .digit - 1
  END
  .v = .sign * .v
  .ok = TRUE
.END

.PROGRAM cw.trim (.$t)
  WHILE $LEFT (.$t, 1) == " " DO
    .$t = $MID (.$t, 2)
  END
  WHILE $RIGHT (.$t, 1) == " " DO
    .$t = $LEFT (.$t, LEN (.$t) - 1)
  END
.END
