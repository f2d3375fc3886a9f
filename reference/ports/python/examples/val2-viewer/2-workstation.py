from contextlib import suppress
from cellwire.blocking import Line, Serial
from cellwire.val2_viewer import Workstation

workstation = Workstation()
with Line(workstation, Serial("/dev/ttyUSB0", 19200)) as line:
    while True:
        line.do(workstation.draw)  # a display cycle
        with suppress(TimeoutError):
            print(line.next(timeout=0.2))
