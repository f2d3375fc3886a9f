"""What the runs have in common: a folder, processes, a bridge's figures; of the smaller ones a broker without a password, simulated cells, a
bridge."""
import atexit
import json
import random
import signal
import socket
import subprocess
import sys
import time
import urllib.request
from pathlib import Path

import paho.mqtt.client as mqtt
from links import LINKS
from pysparkplug import _protobuf as pb

GROUP, NODE = "site-3", "bridge-1"
# The file of a broker that keeps every message for a client that is away.
QUEUES = """\
user root
listener {port}
allow_anonymous true
max_inflight_messages 0
max_queued_messages 10000000
persistence true
persistence_location {folder}/
autosave_interval 0
"""


def free_port():
    """Of those that the system gives to nobody who asks for any: the simulators do."""
    while True:
        port = random.randrange(20_000, 30_000)
        with socket.socket() as found:
            try:
                found.bind(("127.0.0.1", port))
                return port
            except OSError:
                pass


def metrics(port):
    """What a bridge says of itself, by the names without what they all begin with; nothing when it does not answer."""
    try:
        text = urllib.request.urlopen(f"http://127.0.0.1:{port}/metrics", timeout=5).read().decode()
    except OSError:
        return {}
    return {line.rsplit(" ", 1)[0].removeprefix("cellwire_bridge_"): float(line.rsplit(" ", 1)[1])
            for line in text.splitlines() if not line.startswith("#")}


class Place:
    """A folder, and the processes that have their output in it."""

    def __init__(self, folder):
        self.folder, self.processes = folder, []
        subprocess.run(["rm", "-rf", folder], check=True)
        folder.mkdir(parents=True)
        atexit.register(self.stop)

    def spawn(self, command, log, **options):
        process = subprocess.Popen(command, stdout=open(self.folder / log, "a"), **options)
        self.processes.append(process)
        return process

    def wait(self, what, condition, seconds=60):
        end = time.time() + seconds
        while time.time() < end:
            found = condition()
            if found:
                return found
            time.sleep(0.05)
        self.fail(f"{what}: not within {seconds:.0f} s")

    def fail(self, why):
        print(f"FAILED: {why}", flush=True)
        for name in ("bridge.log", "bridge.err", "broker.log"):
            path = self.folder / name
            if path.exists():
                print(f"-- {name}\n" + "\n".join(path.read_text().splitlines()[-15:]))
        self.stop()
        sys.exit(1)

    def stop(self):
        for process in self.processes:
            if process.poll() is None:
                process.send_signal(signal.SIGCONT)
                process.kill()
            process.wait()


class Ground(Place):
    def __init__(self, cellwire, folder, broker="listener {port} 127.0.0.1\nallow_anonymous true\n"):
        super().__init__(folder)
        self.cellwire = str(cellwire)
        self.broker_port, self.health_port = free_port(), free_port()
        (folder / "mosquitto.conf").write_text(broker.format(port=self.broker_port, folder=folder))
        self.start_broker()

    def start_broker(self):
        self.broker = self.spawn(["mosquitto", "-c", str(self.folder / "mosquitto.conf")], "broker.log", stderr=subprocess.STDOUT)

    def simulate(self, count, links=LINKS, **options):
        kinds = [links[index % len(links)] for index in range(count)]
        self.cells = [kind(f"{kind.NAME}-{index // len(links) + 1}", self.cellwire, self.folder, self.spawn, **options)
                      for index, kind in enumerate(kinds)]
        for cell in self.cells:
            self.wait(f"the simulator of {cell.name}", cell.ready)

    def write_site(self, tables, more=""):
        (self.folder / "site.toml").write_text(f"""\
[broker]
address = "127.0.0.1:{self.broker_port}"
group = "{GROUP}"
node = "{NODE}"
{more}
[store]
file = "site.redb"
[health]
listen = "127.0.0.1:{self.health_port}"
{tables}
""")

    def start_bridge(self):
        command = [str(Path(self.cellwire).with_name("cellwire-bridge")), "--config", str(self.folder / "site.toml")]
        self.bridge = self.spawn(command, "bridge.log")

    def order(self, name, id, order):
        payload = pb.Payload(timestamp=int(time.time() * 1000))
        payload.metrics.add(name="Command/Request", datatype=12, timestamp=payload.timestamp,
                            string_value=json.dumps({"id": id, **order}))
        client = mqtt.Client("commander", protocol=mqtt.MQTTv5)
        client.connect("127.0.0.1", self.broker_port)
        client.loop_start()
        client.publish(f"spBv1.0/{GROUP}/DCMD/{NODE}/{name}", payload.SerializeToString(), qos=1).wait_for_publish()
        client.disconnect()
        client.loop_stop()
