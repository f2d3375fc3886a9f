from contextlib import suppress
from cellwire.blocking import Line, Serial
from cellwire.session import NotTaken
from cellwire.val2_alter import Controller

controller = Controller()
with Line(controller, Serial("/dev/ttyUSB0", 38400)) as line:
    while True:
        with suppress(NotTaken):
            line.do(controller.start)
        with suppress(TimeoutError):
            print(line.next(timeout=1.0))
