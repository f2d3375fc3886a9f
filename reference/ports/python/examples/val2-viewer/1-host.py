from contextlib import suppress
from cellwire.blocking import Line, Serial
from cellwire.val2_viewer import Host

host = Host()
with Line(host, Serial("/dev/ttyUSB0", 19200)) as line:
    while True:
        line.do(host.set_pose, [16384, 0, 0, 0, 16384, 0, 0, 0, 16384, 640, 0, 0])
        with suppress(TimeoutError):
            print(line.next(timeout=0.1))
