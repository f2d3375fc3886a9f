from contextlib import suppress
from cellwire.blocking import Line, Serial
from cellwire.isra_ball import Ball

ball = Ball()
with Line(ball, Serial("/dev/ttyUSB0", 9600)) as line:
    while True:
        line.do(ball.measure, force=[10, 0, -3], moment=[0, 0, 0], keys=0)
        with suppress(TimeoutError):
            print(line.next(timeout=0.02))
