; The communication task: load into a PC program and start cw.comm.pc.
;
; x.link    0 no connection, 1 connected
; x.order   the active order, 0 for none
; x.stage   0 idle, 1 jobs are asked for, 2 the list is being cleared, 3 no job follows, 4 interrupted, 5 alarm
; x.flow    1 jobs are asked for, 2 the queue is full, 3 not before x.t.pause
; x.gap     0 no job is missing; 1 a message failed: the rest of its packet is destroyed; 2 asked for again;
;           3 an end came in place of the jobs; 4 asked for once more: another end is obeyed
; x.rec     the next job was asked for, and a step of recovery is due at x.t.step; x.fails steps were taken
; x.last    the number of the job queued last, x.done of the one executed last; 0 for none
; x.open    queued and not executed; x.toack: executed and not acknowledged

.PROGRAM cw.comm.pc ()
  CALL cw.settings
  CALL cw.init
  WHILE TRUE DO
    CALL cw.pass
  END
.END

.PROGRAM cw.init ()
  SIGNAL -cw.s.up, -cw.s.clear, -cw.s.reset, -cw.s.alarm
  TIMER (1) = 0
  x.now = 0
  x.link = 0
  x.late = 0
  x.order = 0
  x.stage = 0
  x.flow = 1
  x.gap = 0
  x.rec = FALSE
  x.fails = 0
  CALL cw.no.jobs
  x.ended = 0
  x.e.done = 0
  x.r.status = FALSE
  x.r.pause = FALSE
  x.r.start = -1
  x.r.end = FALSE
  CALL cw.init.times
  CALL cw.init.queue
  SIGNAL cw.s.up
.END

.PROGRAM cw.init.times ()
  x.t.con = 0
  x.t.stat = 0
  x.t.ready = 0
  x.t.before = 0
  x.t.over = 0
  x.t.pause = 0
  x.t.step = 0
.END

; All numbers of an order that has no jobs yet.
.PROGRAM cw.no.jobs ()
  x.last = 0
  x.done = 0
  x.open = 0
  x.toack = 0
  x.acked = 0
  x.phase = 0
.END

; A real has 24 bits: a timer that runs for hours loses its milliseconds. All times are set back together.
.PROGRAM cw.clock ()
  x.now = TIMER (1)
  IF x.now < 1000 THEN
    RETURN
  END
  TIMER (1) = TIMER (1) - 1000
  x.now = x.now - 1000
  x.t.con = x.t.con - 1000
  x.t.stat = x.t.stat - 1000
  x.t.ready = x.t.ready - 1000
  x.t.before = x.t.before - 1000
  x.t.over = x.t.over - 1000
  x.t.pause = x.t.pause - 1000
  x.t.step = x.t.step - 1000
.END

.PROGRAM cw.pass ()
  CALL cw.clock
  CALL cw.queue
  CALL cw.signals
  IF x.link == 0 THEN
    CALL cw.open
    RETURN
  END
  CALL cw.recover
  IF x.wait THEN
    CALL cw.answer
  ELSE
    CALL cw.send
  END
.END

; Requests of the motion program and of the operator.
.PROGRAM cw.signals ()
  IF SIG (cw.s.clear) THEN
    SIGNAL -cw.s.clear
    CALL cw.clear
  END
  IF SIG (cw.s.reset) THEN
    SIGNAL -cw.s.reset
    CALL cw.interrupt
  END
.END

.PROGRAM cw.open ()
  IF x.now < x.t.con THEN
    .time = x.t.con - x.now
    IF .time > cw.t.idle THEN
      .time = cw.t.idle
    END
    TWAIT .time
    RETURN
  END
  TCP_CONNECT x.socket, cw.port, cw.ip[1], cw.tmo.con
  CALL cw.clock
  IF x.socket < 0 THEN
    x.t.con = x.now + cw.t.connect
    RETURN
  END
  CALL cw.connected
.END

.PROGRAM cw.connected ()
  x.link = 1
  $x.in = ""
  x.wait = FALSE
  x.silent = 0
  x.late = 0
  x.synced = FALSE
  x.t.ready = x.now
  x.t.stat = x.now + cw.t.status
  ; The status reports it all; a start whose answer was lost is repeated
  x.r.status = TRUE
  x.r.start = -1
  x.phase = (x.phase + x.toack) MOD cw.every
  x.acked = x.done
  x.toack = 0
  IF x.stage == 1 THEN
    CALL cw.end.pause
    x.gap = 1
  END
.END

; The connection is lost, or given up. Where nothing is left to execute that is a step of recovery.
.PROGRAM cw.lost ()
  TCP_CLOSE .ret, x.socket
  x.link = 0
  x.t.con = x.now + cw.t.connect
  CALL cw.collect
  IF x.stage <> 1 THEN
    RETURN
  END
  x.rec = FALSE
  IF x.open == 0 THEN
    CALL cw.step
  END
.END

; Whether the connection still is: a result below 0 may be a time that is over.
.PROGRAM cw.alive (.ok)
  .ok = FALSE
  TCP_STATUS .n, .port[0], .socket[0], .err[0], .sub[0], .$ip[0]
  IF .n <= 0 THEN
    RETURN
  END
  FOR .i = 0 TO .n - 1
    IF .socket[.i] == x.socket AND .err[.i] == 0 THEN
      .ok = TRUE
    END
  END
.END

.PROGRAM cw.answer ()
  IF x.now >= x.t.over THEN
    CALL cw.no.answer
    RETURN
  END
  TCP_RECV .ret, x.socket, $x.buf[1], .n, cw.tmo.rcv, 255
  CALL cw.clock
  IF .ret < 0 THEN
    CALL cw.alive (.ok)
    IF NOT .ok THEN
      CALL cw.lost
    END
    RETURN
  END
  IF .n == 0 THEN
    TWAIT 0.002
    RETURN
  END
  FOR .i = 1 TO .n
    CALL cw.unpack (.i)
  END
  IF x.answered AND $x.in == "" THEN
    CALL cw.answered
  END
.END

; An answer is whole. After a cycle without one it may be that one's: then this one's is still to come.
.PROGRAM cw.answered ()
  x.silent = 0
  x.synced = TRUE
  x.heard = TRUE
  x.answered = FALSE
  IF x.late > 0 THEN
    x.late = x.late - 1
    RETURN
  END
  CALL cw.next.cycle
.END

.PROGRAM cw.next.cycle ()
  x.wait = FALSE
  x.t.ready = x.t.before
  IF x.t.ready < x.now THEN
    x.t.ready = x.now
  END
.END

.PROGRAM cw.no.answer ()
  CALL cw.next.cycle
  IF x.heard THEN
    ; An earlier cycle's, and none follows it
    x.late = 0
    RETURN
  END
  x.late = x.late + 1
  x.silent = x.silent + 1
  CALL cw.say ("noreply", x.silent, 0)
  IF x.silent == cw.silent THEN
    CALL cw.say ("disconnect", 0, 0)
    CALL cw.lost
  END
.END

; What happens, where it is to be seen.
.PROGRAM cw.say (.$what, .a, .b)
  IF cw.log THEN
    PRINT .$what, " ", .a, " ", .b
  END
.END
