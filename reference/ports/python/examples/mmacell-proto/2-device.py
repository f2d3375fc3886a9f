from cellwire.blocking import Line, Listen
from cellwire.mmacell_proto import Device

device = Device(device="robot")
device.set_pose([0.0, 0.0, 100.0, 0.0])
with Line(device, Listen("127.0.0.1", 2001)) as line:
    for event in line:
        print(event)
        if event["event"] == "asked":
            line.do(device.accept, event["order"])
            device.set_pose(event["order"].get("target", [0.0, 0.0, 100.0, 0.0]))  # moves at once
            device.arrived()
