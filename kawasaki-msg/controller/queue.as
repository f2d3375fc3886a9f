; The queue between the two tasks, and what the communication task does about it.
;
; x.ok[1..cw.size] of a place: 0 free, 1 a job waits, 2 it is being executed, 3 it is executed. The communication task
; makes 1 of 0 and 0 of 3, the motion task 2 of 1 and 3 of 2. Where the list is cleared (x.clr) the motion task makes 0 of 1,
; and then takes x.clr back: no job is pulled away from under it.
; x.wr is where the next job is written, x.rd where it is read, x.front the oldest job that is not known to be executed.

.PROGRAM cw.init.queue ()
  ; The motion task may be running: it answers when it has seen that the list is cleared
  x.clr = TRUE
  x.wipe = TRUE
  x.rd = 1
  FOR .i = 1 TO cw.size
    x.ok[.i] = 0
  END
.END

.PROGRAM cw.queue ()
  ; Looked at before what is executed is collected: nothing can come after it then
  .settled = NOT x.clr
  CALL cw.collect
  IF .settled THEN
    CALL cw.settled
  END
  IF x.stage == 1 AND x.flow == 2 AND x.open <= cw.low THEN
    x.flow = 1
    CALL cw.say ("drained", x.last, 0)
  END
.END

.PROGRAM cw.collect ()
  IF x.wipe THEN
    RETURN
  END
  WHILE x.ok[x.front] == 3 DO
    x.ok[x.front] = 0
    x.front = x.front MOD cw.size + 1
    CALL cw.executed
  END
.END

.PROGRAM cw.executed ()
  x.done = x.done MOD cw.max + 1
  x.open = x.open - 1
  x.toack = x.toack + 1
  x.rec = FALSE
  x.fails = 0
.END

; No list is being cleared, and all that was executed is known.
.PROGRAM cw.settled ()
  IF x.wipe THEN
    CALL cw.from.first
    x.wipe = FALSE
  END
  IF x.stage == 2 THEN
    x.last = x.done
    x.open = 0
    CALL cw.from.front
    x.stage = 1
    x.flow = 1
    x.gap = 1
    x.rec = FALSE
    CALL cw.say ("cleared", x.last, 0)
  END
  IF x.stage == 4 THEN
    CALL cw.from.front
    CALL cw.over
  END
  IF x.stage == 3 AND x.open == 0 THEN
    CALL cw.over
  END
.END

; Both tasks begin at the first place.
.PROGRAM cw.from.first ()
  FOR .i = 1 TO cw.size
    x.ok[.i] = 0
  END
  x.front = 1
  CALL cw.from.front
.END

.PROGRAM cw.from.front ()
  x.rd = x.front
  x.wr = x.front
.END

.PROGRAM cw.over ()
  CALL cw.say ("over", x.order, x.done)
  x.ended = x.order
  x.e.done = x.done
  x.order = 0
  x.stage = 0
  x.last = x.done
  x.open = 0
  ; The end reports it
  x.acked = x.done
  x.toack = 0
  x.r.status = TRUE
  x.r.end = TRUE
  x.r.pause = FALSE
.END

; The first reset: the list. It leads out of an alarm.
.PROGRAM cw.clear ()
  IF x.stage <> 1 AND x.stage <> 5 THEN
    RETURN
  END
  IF x.stage == 5 THEN
    x.r.status = TRUE
    SIGNAL -cw.s.alarm
  END
  x.stage = 2
  x.fails = 0
  x.clr = TRUE
.END

; The second reset, and the PC's interruption: the order.
.PROGRAM cw.interrupt ()
  IF x.order == 0 OR x.stage == 4 THEN
    RETURN
  END
  x.stage = 4
  x.r.status = TRUE
  SIGNAL -cw.s.alarm
  x.clr = TRUE
  CALL cw.say ("interrupted", x.order, 0)
.END

.PROGRAM cw.end.pause ()
  IF x.flow == 3 AND x.now >= x.t.pause THEN
    x.flow = 1
  END
.END

.PROGRAM cw.recover ()
  IF x.stage <> 1 THEN
    RETURN
  END
  CALL cw.end.pause
  IF x.rec AND x.now >= x.t.step THEN
    CALL cw.step
  END
.END

; Nothing is left to execute, and the next job does not come: a request, a pause, a clear, the alarm.
.PROGRAM cw.step ()
  x.rec = FALSE
  x.fails = x.fails + 1
  IF x.fails <= cw.resends THEN
    CALL cw.say ("resend", x.last, 0)
    RETURN
  END
  IF x.fails <= cw.resends + cw.pauses THEN
    x.flow = 3
    x.t.pause = x.now + cw.t.pause
    x.r.pause = TRUE
    CALL cw.say ("pause", x.last, 0)
    RETURN
  END
  IF x.fails <= cw.resends + cw.pauses + cw.clears THEN
    x.stage = 2
    x.clr = TRUE
    CALL cw.say ("clear", x.last, 0)
    RETURN
  END
  x.stage = 5
  x.r.status = TRUE
  SIGNAL cw.s.alarm
  CALL cw.say ("alarm", x.order, x.last)
.END
