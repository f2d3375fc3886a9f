from cellwire.blocking import Line, Serial
from cellwire.laser_eb90 import Host

host = Host()
with Line(host, Serial("/dev/ttyUSB0", 9600)) as line:
    for x in range(7):
        line.do(host.submit, 0x0101, [{"f32": [float(x), 0.0]}])
    queued = line.next(timeout=10.0)
    print(queued)
    if queued["event"] != "done":
        raise SystemExit("look at the robot before any of these instructions is sent again")
    line.do(host.submit, 0x0301)
    print(line.next(timeout=10.0))  # the answer of a query
