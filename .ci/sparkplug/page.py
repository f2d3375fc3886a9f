"""The page of a bridge in Chromium: 50 cells, a hostile name, a cell that dies, a broker that goes, a bridge that ends."""
import argparse
import json
import random
import socket
import subprocess
import sys
import time
from pathlib import Path

import paho.mqtt.client as mqtt
from links import LINKS
from pysparkplug import _protobuf as pb

parser = argparse.ArgumentParser()
parser.add_argument("cellwire")
parser.add_argument("place", type=Path)
parser.add_argument("--cells", type=int, default=50)
args = parser.parse_args()
folder = args.place / "page"
subprocess.run(["rm", "-rf", folder], check=True)
folder.mkdir(parents=True)
processes = []
HOSTILE = "<img src=x onerror=alert(1)>"


def spawn(command, log, **options):
    process = subprocess.Popen(command, stdout=open(folder / log, "a"), **options)
    processes.append(process)
    return process


def fail(why):
    print(f"FAILED: {why}")
    stop()
    sys.exit(1)


def stop():
    for process in processes:
        process.kill()
        process.wait()


def free_port():
    while True:
        port = random.randrange(20_000, 30_000)
        with socket.socket() as found:
            try:
                found.bind(("127.0.0.1", port))
                return port
            except OSError:
                pass


broker_port, page_port = free_port(), free_port()
(folder / "mosquitto.conf").write_text(f"listener {broker_port} 127.0.0.1\nallow_anonymous true\n")
start_broker = lambda: spawn(["mosquitto", "-c", str(folder / "mosquitto.conf")], "broker.log", stderr=subprocess.STDOUT)
broker = start_broker()
cells = [LINKS[index % len(LINKS)](f"{LINKS[index % len(LINKS)].NAME}-{index // len(LINKS) + 1}", args.cellwire, folder, spawn)
         for index in range(args.cells)]
for cell in cells:
    while not cell.ready():
        time.sleep(0.05)
hostile = cells[-1]
hostile.name = HOSTILE
tables = "\n".join(cell.table().replace(f"[cell.{HOSTILE}]", f"[cell.'{HOSTILE}']") for cell in cells)
(folder / "hall.toml").write_text(f"""\
[broker]
address = "127.0.0.1:{broker_port}"
group = "hall-3"
node = "bridge-1"
[store]
file = "hall.redb"
[health]
listen = "127.0.0.1:{page_port}"
{tables}
""")
bridge_path = str(Path(args.cellwire).with_name("cellwire-bridge"))
bridge = spawn([bridge_path, "--config", str(folder / "hall.toml")], "bridge.log")
time.sleep(2)
script = Path(__file__).parents[1] / "page/page.mjs"
look = subprocess.Popen(["node", script, args.place / "node", f"http://127.0.0.1:{page_port}", folder], stdin=subprocess.PIPE,
                        stdout=subprocess.PIPE, text=True)
processes.append(look)


def step(step, **rest):
    look.stdin.write(json.dumps({"step": step, **rest}) + "\n")
    look.stdin.flush()
    answer = json.loads(look.stdout.readline() or '{"failed": "the browser has ended"}')
    if "ok" not in answer:
        fail(answer)
    print("ok", step, *rest.values())


def order(cell, id, order):
    payload = pb.Payload(timestamp=int(time.time() * 1000))
    metric = payload.metrics.add(name="Command/Request", datatype=12, timestamp=int(time.time() * 1000))
    metric.string_value = json.dumps({"id": id, **order})
    client = mqtt.Client("commander", protocol=mqtt.MQTTv5)
    client.connect("127.0.0.1", broker_port)
    client.loop_start()
    client.publish(f"spBv1.0/hall-3/DCMD/bridge-1/{cell.name}", payload.SerializeToString(), qos=1).wait_for_publish()
    client.disconnect()
    client.loop_stop()


step("shows", selector="#name", pattern="^hall-3 / bridge-1$")
step("shows", selector="#cells-alive", pattern=f"^{args.cells} of {args.cells} alive$")
step("shows", selector="#broker-state", pattern="^online$")
step("shows", selector="#rate", pattern="[1-9]")
step("harmless", text=HOSTILE)
kawasaki = cells[0]
for cell in cells[:7]:
    for id, what, _ in cell.orders(1):
        order(cell, id, what)
order(kawasaki, *kawasaki.slow_order())
step("shows", selector="#orders tr", pattern=f"under way{kawasaki.name}{kawasaki.name}/slow")
step("shows", selector="#orders tr.good", pattern="done")
step("shows", selector="#orders tr.bad", pattern="refused")
step("picture", name="commands", at="#commands-title")
dying = cells[5]
dying.stop()
step("shows", selector="#rows tr.bad:first-child", pattern=f"^{dying.name}dead .*cannot connect|^{dying.name}dead .*closed")
step("shows", selector="#cells-alive", pattern=f"^{args.cells - 1} of {args.cells} alive$")
step("picture", name="hall")
step("wrong")
broker.kill()
broker.wait()
step("shows", selector="#broker-state", pattern="^offline$")
step("shows", selector="#broker-why", pattern="refused|closed|reset|peer")
step("shows", selector="#store-records", pattern="[1-9][0-9]{2,} wait")
step("picture", name="no-broker")
broker = start_broker()
step("shows", selector="#broker-state", pattern="^online$")
step("shows", selector="#store-records", pattern="^[0-9]{1,2} wait")
step("wrong")
bridge.kill()
bridge.wait()
step("shows", selector="#news", pattern="no news from the bridge for")
step("picture", name="no-bridge")
bridge = spawn([bridge_path, "--config", str(folder / "hall.toml")], "bridge.log")
step("shows", selector="#news", pattern="^live$")
step("shows", selector="#cells-alive", pattern=f"^{args.cells - 1} of {args.cells} alive$")
step("wrong", but="ERR_CONNECTION_REFUSED|ERR_INCOMPLETE_CHUNKED_ENCODING")
stop()
print(f"done; the pictures are in {folder}")
