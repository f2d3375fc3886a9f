; What the messages of the PC mean.

.PROGRAM cw.message ()
  IF $x.name == $cw.job THEN
    ; What follows a failed message in its packet is destroyed unread
    IF x.stage == 1 AND x.gap <> 1 THEN
      CALL cw.job
    END
    RETURN
  END
  IF $x.name == $cw.filler THEN
    RETURN
  END
  IF $x.name == $cw.status THEN
    CALL cw.read (2, 5, .ok)
    IF .ok AND cw.foreign AND x.v[1] <> x.order THEN
      CALL cw.interrupt
    END
    RETURN
  END
  CALL cw.of.order
.END

.PROGRAM cw.of.order ()
  IF $x.name == $cw.start THEN
    CALL cw.read (2, 2, .ok)
    IF .ok THEN
      CALL cw.start (x.v[1], x.v[2])
    END
    RETURN
  END
  IF $x.name == $cw.end THEN
    CALL cw.read (1, 1, .ok)
    IF .ok THEN
      CALL cw.finish (x.v[1])
    END
    RETURN
  END
  IF $x.name == $cw.interrupt THEN
    CALL cw.read (1, 1, .ok)
    IF .ok THEN
      CALL cw.break.off (x.v[1])
    END
    RETURN
  END
  CALL cw.other
.END

; Our own messages are not looked at; one of no known name may have been a job.
.PROGRAM cw.other ()
  IF $x.name == $cw.joback OR $x.name == $cw.request OR $x.name == $cw.pause THEN
    RETURN
  END
  IF $x.name == $cw.startack OR $x.name == $cw.endack THEN
    RETURN
  END
  CALL cw.say ("unknown", 0, 0)
  CALL cw.failed
.END

; The fields of a message: .must of .all are numbers, the others may be empty. The first is an order.
.PROGRAM cw.read (.must, .all, .ok)
  CALL cw.split (.must)
  .ok = FALSE
  IF x.n == .all AND x.bad == 0 THEN
    .ok = x.v[1] >= 0 AND x.v[1] <= 65535
  END
  IF NOT .ok THEN
    CALL cw.say ("rejected", x.bad, 0)
    CALL cw.failed
  END
.END

.PROGRAM cw.job ()
  CALL cw.split (9)
  IF x.bad <> 0 OR x.n < 2 THEN
    CALL cw.bad.job
    RETURN
  END
  .next = x.last MOD cw.max + 1
  IF x.v[1] <> x.order OR x.v[2] <> .next THEN
    CALL cw.not.next
    RETURN
  END
  IF x.ok[x.wr] <> 0 THEN
    CALL cw.collect
  END
  IF x.ok[x.wr] <> 0 THEN
    CALL cw.full
    RETURN
  END
  CALL cw.job.fields (x.wr, .ok)
  IF NOT .ok THEN
    CALL cw.bad.job
    RETURN
  END
  ; From here on it is the motion task's
  x.ok[x.wr] = 1
  x.wr = x.wr MOD cw.size + 1
  x.last = .next
  x.open = x.open + 1
  x.gap = 0
  x.rec = FALSE
.END

; The fields of a job: what they are in the message, their limits, and where the motion task finds them. Coordinates are
; hundredths of a millimetre in the message and millimetres in the queue.
.PROGRAM cw.job.fields (.i, .ok)
  .ok = FALSE
  IF x.n <> 7 OR (x.v[3] <> 1 AND x.v[3] <> 2) THEN
    RETURN
  END
  IF x.v[4] < cw.x.min OR x.v[4] > cw.x.max OR x.v[5] < cw.y.min OR x.v[5] > cw.y.max THEN
    RETURN
  END
  IF x.v[6] < cw.x.min OR x.v[6] > cw.x.max OR x.v[7] < cw.y.min OR x.v[7] > cw.y.max THEN
    RETURN
  END
  j.number[.i] = x.v[2]
  j.draw[.i] = x.v[3] == 1
  j.x1[.i] = x.v[4] / 100
  j.y1[.i] = x.v[5] / 100
  j.x2[.i] = x.v[6] / 100
  j.y2[.i] = x.v[7] / 100
  .ok = TRUE
.END

.PROGRAM cw.bad.job ()
  CALL cw.say ("badjob", x.bad, 0)
  CALL cw.failed
.END

; A job that is not the next one: one that was queued before is harmless, and what follows it may be new.
.PROGRAM cw.not.next ()
  .ahead = (x.v[2] + cw.max - x.last) MOD cw.max
  IF x.v[1] == x.order AND x.v[2] >= 1 AND x.v[2] <= cw.max THEN
    IF .ahead < 2 OR .ahead > INT (cw.max / 2) THEN
      CALL cw.say ("repeated", x.v[2], 0)
      RETURN
    END
  END
  CALL cw.say ("notnext", x.v[1], x.v[2])
  CALL cw.failed
.END

.PROGRAM cw.full ()
  IF x.flow <> 2 THEN
    x.flow = 2
    x.r.pause = TRUE
  END
  x.gap = 1
  CALL cw.say ("full", x.last, 0)
.END

; Refused without a motion task: it has not answered since the start.
.PROGRAM cw.start (.order, .first)
  x.r.status = TRUE
  IF x.order <> 0 THEN
    CALL cw.start.again (.order, .first)
    RETURN
  END
  IF .order == 0 OR .first <> 1 OR x.wipe THEN
    x.r.start = 0
    CALL cw.say ("refused", .order, 0)
    RETURN
  END
  x.order = .order
  x.stage = 1
  x.flow = 1
  x.gap = 0
  x.rec = FALSE
  x.fails = 0
  CALL cw.no.jobs
  x.r.start = .order
  CALL cw.say ("started", .order, 0)
.END

; The active order, of which nothing has come: the answer was lost. Nothing begins again.
.PROGRAM cw.start.again (.order, .first)
  IF .order == x.order AND x.last == 0 AND .first == 1 THEN
    x.r.start = x.order
    RETURN
  END
  x.r.start = x.order
  IF cw.refuse AND .order == x.order THEN
    x.r.start = 0
  END
  CALL cw.say ("refused", .order, x.order)
.END

; The order's end. Where jobs are missing it counts when it has come twice, each time to a request, and is not a late answer.
.PROGRAM cw.finish (.order)
  IF .order == 0 OR .order <> x.order THEN
    CALL cw.end.again (.order)
    RETURN
  END
  IF x.stage == 2 OR x.stage == 3 OR x.stage == 4 THEN
    RETURN
  END
  IF x.stage == 1 AND x.gap >= 1 AND x.gap <= 3 THEN
    IF x.gap > 1 THEN
      IF x.late == 0 THEN
        x.gap = 3
      END
      CALL cw.say ("missing", x.last, 0)
    END
    RETURN
  END
  x.stage = 3
  x.r.status = TRUE
  SIGNAL -cw.s.alarm
  CALL cw.say ("ending", .order, 0)
.END

.PROGRAM cw.break.off (.order)
  IF .order == 0 OR .order <> x.order THEN
    CALL cw.end.again (.order)
    RETURN
  END
  CALL cw.interrupt
.END

; The end of an order that is not active: acknowledged again if it was the last one; else the status says which is.
.PROGRAM cw.end.again (.order)
  IF .order <> 0 AND .order == x.ended THEN
    x.r.end = TRUE
  ELSE
    x.r.status = TRUE
  END
.END
