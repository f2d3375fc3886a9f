from cellwire.blocking import Line, Tcp
from cellwire.kawasaki_msg import Robot
from cellwire.session import NotTaken

robot = Robot()
with Line(robot, Tcp("127.0.0.1", 9105)) as line:
    while True:
        try:
            print(line.next(timeout=0.01))
        except TimeoutError:
            try:
                job = line.do(robot.take)  # it is executed here …
            except NotTaken:
                continue  # no job waits
            line.do(robot.job_done, job["number"])
            line.do(robot.complete)  # … and its slot is free
