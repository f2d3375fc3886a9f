; What is sent: one packet in each cycle, of at least one message, in strings of up to 255 bytes.

.PROGRAM cw.send ()
  IF x.now < x.t.ready THEN
    TWAIT x.t.ready - x.now
    RETURN
  END
  x.on = 1
  x.len = 0
  $x.out[1] = ""
  CALL cw.fill
  IF x.len == 0 THEN
    CALL cw.put ($cw.filler, "", .ok)
  END
  TCP_SEND .ret, x.socket, $x.out[1], x.on, cw.tmo.snd
  CALL cw.clock
  x.wait = TRUE
  x.answered = FALSE
  x.heard = FALSE
  x.t.before = x.now + cw.t.exchange
  x.t.over = x.now + cw.t.reply
  IF .ret < 0 THEN
    CALL cw.lost
  END
.END

; What has no room waits for the next packet.
.PROGRAM cw.fill ()
  .status = x.r.status OR x.now >= x.t.stat
  .asks = x.synced AND x.stage == 1 AND x.flow == 1
  CALL cw.acks (NOT (.status OR .asks OR x.r.pause OR x.r.start >= 0))
  IF x.r.start >= 0 THEN
    CALL cw.put ($cw.startack, $ENCODE (/L, x.r.start), .ok)
    IF .ok THEN
      x.r.start = -1
    END
  END
  IF x.r.end THEN
    CALL cw.put.end
  END
  IF .status THEN
    CALL cw.put.status
  END
  IF x.r.pause THEN
    CALL cw.put.pause
  END
  IF x.stage == 1 AND x.flow == 1 THEN
    CALL cw.ask
  END
.END

; Every cw.every-th job, and the rest where there is nothing else to send or to execute.
.PROGRAM cw.acks (.idle)
  .ok = TRUE
  WHILE x.toack > 0 AND .ok DO
    .step = cw.every - x.phase
    IF .step > x.toack THEN
      IF x.open > 0 AND NOT .idle THEN
        RETURN
      END
      .step = x.toack
    END
    .no = (x.acked + .step - 1) MOD cw.max + 1
    CALL cw.put ($cw.joback, $ENCODE (/L, x.order) + "$" + $ENCODE (/L, .no), .ok)
    IF .ok THEN
      x.acked = .no
      x.toack = x.toack - .step
      x.phase = (x.phase + .step) MOD cw.every
    END
  END
.END

; Another order may have begun since.
.PROGRAM cw.put.end ()
  CALL cw.optional (x.e.done, .$done)
  .$d = $ENCODE (/L, x.ended) + "$" + $ENCODE (/L, x.order) + "$" + .$done
  CALL cw.put ($cw.endack, .$d, .ok)
  IF .ok THEN
    x.r.end = FALSE
  END
.END

.PROGRAM cw.put.status ()
  .phase = x.stage
  IF x.stage == 1 THEN
    .phase = 2
  END
  CALL cw.optional (x.last, .$last)
  CALL cw.optional (x.done, .$done)
  CALL cw.optional (x.ended, .$ended)
  .$d = $ENCODE (/L, x.order) + "$" + $ENCODE (/L, .phase) + "$" + .$last + "$" + .$done + "$" + .$ended
  CALL cw.put ($cw.status, .$d, .ok)
  IF .ok THEN
    x.r.status = FALSE
    x.t.stat = x.now + cw.t.status
  END
.END

.PROGRAM cw.put.pause ()
  CALL cw.optional (x.last, .$last)
  CALL cw.put ($cw.pause, $ENCODE (/L, x.order) + "$" + .$last, .ok)
  IF .ok THEN
    x.r.pause = FALSE
  END
.END

; The jobs from the next one on; if nothing is left to execute, they are to come within cw.t.patience.
.PROGRAM cw.ask ()
  IF x.synced THEN
    CALL cw.put ($cw.request, $ENCODE (/L, x.order) + "$" + $ENCODE (/L, x.last MOD cw.max + 1), .ok)
    IF .ok AND x.gap == 1 THEN
      x.gap = 2
    END
    IF .ok AND x.gap == 3 THEN
      x.gap = 4
    END
  END
  IF x.open == 0 AND NOT x.rec THEN
    x.rec = TRUE
    x.t.step = x.now + cw.t.patience
  END
.END

; A number that does not exist yet is empty.
.PROGRAM cw.optional (.n, .$t)
  .$t = ""
  IF .n > 0 THEN
    .$t = $ENCODE (/L, .n)
  END
.END

; Adds a message: it may go on in the next string.
.PROGRAM cw.put (.$name, .$data, .ok)
  .$m = "<" + .$name + "$" + $ENCODE (/L, LEN (.$data)) + "#" + .$data + "#>"
  .ok = x.len + LEN (.$m) <= cw.packet
  IF NOT .ok THEN
    RETURN
  END
  x.len = x.len + LEN (.$m)
  .room = 255 - LEN ($x.out[x.on])
  IF LEN (.$m) <= .room THEN
    $x.out[x.on] = $x.out[x.on] + .$m
    RETURN
  END
  $x.out[x.on] = $x.out[x.on] + $LEFT (.$m, .room)
  x.on = x.on + 1
  $x.out[x.on] = $MID (.$m, .room + 1)
.END
