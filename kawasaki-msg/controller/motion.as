; The motion task: load into the robot program and execute cw.motion.

.PROGRAM cw.motion ()
  CALL cw.settings
  m.known = FALSE
  m.x = 0
  m.y = 0
  SPEED cw.speed MM/S ALWAYS
  WAIT SIG (cw.s.up)
  CALL cw.half.done
  WHILE TRUE DO
    WAIT x.clr OR (x.ok[x.rd] == 1)
    IF x.clr THEN
      CALL cw.sweep
    ELSE
      CALL cw.work
    END
  END
.END

; The program was stopped in the middle of a job, and begun anew: how much of it is done nobody knows. The order is over.
.PROGRAM cw.half.done ()
  IF x.ok[x.rd] == 2 THEN
    x.ok[x.rd] = 1
    SIGNAL cw.s.reset
    WAIT x.clr
  END
.END

; Reported as executed when it is, and not before: BREAK waits for the arm.
.PROGRAM cw.work ()
  .i = x.rd
  x.ok[.i] = 2
  CALL cw.draw (j.draw[.i], j.x1[.i], j.y1[.i], j.x2[.i], j.y2[.i])
  BREAK
  x.rd = .i MOD cw.size + 1
  x.ok[.i] = 3
.END

.PROGRAM cw.sweep ()
  WHILE x.ok[x.rd] == 1 DO
    x.ok[x.rd] = 0
    x.rd = x.rd MOD cw.size + 1
  END
  x.clr = FALSE
.END

; One line, from where the arm is: with the pen up to its beginning, unless it is there.
.PROGRAM cw.draw (.draw, .x1, .y1, .x2, .y2)
  .z = cw.pen.up
  IF .draw THEN
    .z = cw.pen.down
  END
  IF NOT m.known OR (.x1 <> m.x) OR (.y1 <> m.y) THEN
    CALL cw.lift (.x1, .y1)
  END
  LMOVE cw.board + TRANS (.x1, .y1, .z)
  LMOVE cw.board + TRANS (.x2, .y2, .z)
  m.known = TRUE
  m.x = .x2
  m.y = .y2
.END

.PROGRAM cw.lift (.x, .y)
  IF m.known THEN
    LMOVE cw.board + TRANS (m.x, m.y, cw.pen.up)
  END
  LMOVE cw.board + TRANS (.x, .y, cw.pen.up)
.END
