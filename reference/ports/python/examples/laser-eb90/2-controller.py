from cellwire.blocking import Line, Listen
from cellwire.laser_eb90 import Controller

controller = Controller()
with Line(controller, Listen("127.0.0.1", 4001)) as line:
    while True:
        try:
            event = line.next(timeout=0.02)
            print(event)
            if event["event"] == "execute":
                line.do(controller.answer, [])
        except TimeoutError:
            for instruction in controller.take():  # the motion task, at its own pace
                print(instruction)
