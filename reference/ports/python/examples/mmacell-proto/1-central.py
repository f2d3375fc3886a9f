import time
from cellwire.blocking import Line, Tcp
from cellwire.mmacell_proto import Central

central = Central(device="robot")
with Line(central, Tcp("192.168.0.1", 2001)) as line:
    def ask(**command):
        line.do(central.request, command)
        return line.next(timeout=5.0)

    print(line.next(timeout=5.0))  # connected
    print(ask(command="SRV", on=True), ask(command="MOV", mode="absolute", axes=[10.0, 0.0, 100.0, 0.0]))
    while (motion := ask(command="STA").get("motion")) != "arrived":
        if isinstance(motion, dict):
            raise SystemExit(motion)  # {"missed": …}: it is at rest elsewhere, or its servo motors are off
        time.sleep(0.05)
    print(motion)
