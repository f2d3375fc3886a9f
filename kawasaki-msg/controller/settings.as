; The settings of one plant. Both tasks call this first: it only sets constants.
; Times in seconds, coordinates in hundredths of a millimetre as they are in the messages, the pen's in millimetres.

.PROGRAM cw.settings ()
  ; The PC
  cw.ip[1] = 192
  cw.ip[2] = 168
  cw.ip[3] = 0
  cw.ip[4] = 10
  cw.port = 9400
  ; The queue: its places, 1 to 9999; the highest job number, which both ends have agreed on, greater than the places
  cw.size = 100
  cw.max = 9999
  ; After a full queue jobs are asked for when so many are left
  cw.low = 50
  ; Every how many jobs an acknowledgement
  cw.every = 1
  ; The coordinates that the arm can reach
  cw.x.min = -9999999
  cw.x.max = 9999999
  cw.y.min = -9999999
  cw.y.max = 9999999
  ; The pen over and on the board, and its speed in mm/s; cw.board is the board's frame, taught
  cw.pen.up = 20
  cw.pen.down = 0
  cw.speed = 250
  CALL cw.set.times
  CALL cw.set.rules
  CALL cw.set.names
.END

.PROGRAM cw.set.times ()
  ; What TCP_CONNECT, TCP_SEND and TCP_RECV may wait
  cw.tmo.con = 1
  cw.tmo.snd = 1
  cw.tmo.rcv = 1
  ; No answer after this; so many times in a row, and the connection is given up (0: never)
  cw.t.reply = 1
  cw.silent = 5
  ; From packet to packet at least
  cw.t.exchange = 0.032
  ; Before a lost connection is opened again
  cw.t.connect = 1
  ; The status is sent at least so often
  cw.t.status = 1
  ; Nothing left to execute and the next job missing: a step of recovery
  cw.t.patience = 1
  cw.t.pause = 0.5
  ; What a pass waits that has nothing to do
  cw.t.idle = 0.1
.END

.PROGRAM cw.set.rules ()
  ; How often each step of recovery is taken before the next; then the alarm
  cw.resends = 3
  cw.pauses = 3
  cw.clears = 1
  ; 0 answers the start of the order that is active and has jobs, not its own number
  cw.refuse = TRUE
  ; An order that the PC's status does not name is ended
  cw.foreign = FALSE
  ; The most bytes of a packet
  cw.packet = 4096
  ; What happens is printed
  cw.log = TRUE
  ; Internal signals: the tasks are set up; requests to clear the list and to forget the order; the alarm
  cw.s.up = 2001
  cw.s.clear = 2002
  cw.s.reset = 2003
  cw.s.alarm = 2004
.END

; What the messages are called.
.PROGRAM cw.set.names ()
  $cw.job = "Tyo"
  $cw.joback = "TyoKuittaus"
  $cw.request = "TyoPyynto"
  $cw.pause = "TyoTauko"
  $cw.start = "TilausAlkaa"
  $cw.startack = "TilausKuittaus"
  $cw.end = "TilausLoppuu"
  $cw.interrupt = "TilausKeskeytyy"
  $cw.endack = "LoppuKuittaus"
  $cw.status = "Tila"
  $cw.filler = "Huuhaa"
.END
