from cellwire.blocking import Line, Listen
from cellwire.kawasaki_msg import Pc

pc = Pc()
jobs = [{"kind": 1, "x1": 100 * x, "y1": 0, "x2": 100 * x + 100, "y2": 0} for x in range(20)]
with Line(pc, Listen("127.0.0.1", 9105)) as line:
    line.do(pc.start, 50, jobs)
    for event in line:
        print(event)
        if event["event"] == "order_over":
            break
        if event["event"] == "outcome_unknown":
            raise SystemExit("check the workpiece before any of these jobs is sent again")
