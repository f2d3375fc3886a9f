"""Faults, one after the other: how long the bridge takes to come back, and what is lost and repeated by the numbers of the records."""
import argparse
import json
import os
import random
import signal
import socket
import subprocess
import sys
import threading
import time
from pathlib import Path

import paho.mqtt.client as mqtt
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.properties import Properties
from pysparkplug._protobuf import sparkplug_b_pb2 as pb

from ground import QUEUES, Place, free_port, metrics
from links import LINKS

parser = argparse.ArgumentParser()
parser.add_argument("cellwire")
parser.add_argument("place", type=Path)
parser.add_argument("--times", type=int, default=3)
parser.add_argument("--cells", type=int, default=len(LINKS))
parser.add_argument("--minutes", type=int, help="a fault a minute, one kind after the other, for so long, in place of --times of each")
parser.add_argument("--longest", type=float, default=30, help="back within so many seconds, or it is a failure")
parser.add_argument("--go-on", action="store_true", help="measure on after a failure")
parser.add_argument("faults", nargs="*")
args = parser.parse_intermixed_args()
BRIDGE = str(Path(args.cellwire).with_name("cellwire-bridge"))
GROUP, NODE, HOST = "site", "bridge-1", "scada"
folder = args.place / "faults"
os.environ["PATH"] += ":/usr/sbin"
failures = []


class Faults(Place):
    def fail(self, why):
        failures.append(why)
        if not args.go_on:
            super().fail(why)
        print(f"FAILED: {why}", flush=True)


place = Faults(folder)
fail, spawn = place.fail, place.spawn


def wait(what, condition, seconds):
    """How long it took."""
    start = time.time()
    return time.time() - start if place.wait(what, condition, seconds) else float("inf")


class Proxy:
    """The network between the bridge and its broker."""

    def __init__(self, to):
        self.to, self.pairs, self.is_cut = to, [], False
        self.listener = socket.create_server(("127.0.0.1", 0))
        self.port = self.listener.getsockname()[1]
        threading.Thread(target=self.accept, daemon=True).start()

    def accept(self):
        while True:
            near, _ = self.listener.accept()
            if self.is_cut:
                near.close()
                continue
            try:
                far = socket.create_connection(("127.0.0.1", self.to), 1)
                far.settimeout(None)
            except OSError:
                near.close()
                continue
            self.pairs.append((near, far))
            for source, sink in ((near, far), (far, near)):
                threading.Thread(target=self.pump, args=(source, sink), daemon=True).start()

    def pump(self, source, sink):
        try:
            while data := source.recv(65536):
                sink.sendall(data)
        except OSError:
            pass
        for end in (source, sink):
            try:
                end.shutdown(socket.SHUT_RDWR)
            except OSError:
                pass

    def cut(self):
        self.is_cut = True
        for pair in self.pairs:
            for end in pair:
                try:
                    end.shutdown(socket.SHUT_RDWR)
                except OSError:
                    pass
        self.pairs.clear()

    def restore(self):
        self.is_cut = False


class Host:
    """A consumer with a session that outlives its connection, and the host application."""

    def __init__(self, port):
        self.last, self.lost, self.repeated, self.alive, self.deaths = {}, 0, 0, {}, {}
        self.outcomes, self.nulls, self.unordered, self.times, self.events = {}, {}, 0, {}, []
        self.client = mqtt.Client("consumer", protocol=mqtt.MQTTv5)
        self.client.on_connect = lambda client, *_: client.subscribe(f"spBv1.0/{GROUP}/#", qos=1)
        self.client.on_message = self.take
        self.client.reconnect_delay_set(1, 1)
        properties = Properties(PacketTypes.CONNECT)
        properties.SessionExpiryInterval, properties.ReceiveMaximum = 3600, 65535
        self.client.connect("127.0.0.1", port, keepalive=10, clean_start=False, properties=properties)
        self.client.loop_start()

    def take(self, _client, _data, message):
        levels = message.topic.split("/")
        if levels[2] not in ("DBIRTH", "DDATA", "DDEATH"):
            return
        payload, cell = pb.Payload.FromString(message.payload), levels[4]
        named = {metric.name: metric for metric in payload.metrics}
        if levels[2] == "DBIRTH":
            self.alive[cell] = True
        elif levels[2] == "DDEATH":
            self.alive[cell] = False
            self.deaths[cell] = named
        else:
            number, last = named["Record/Number"].long_value, self.last.get(cell)
            if last is not None and number <= last:
                self.repeated += 1
                return
            self.lost += 0 if last is None else number - last - 1
            self.last[cell] = number
            if "Command/Id" in named:
                outcome = (named["Command/Outcome"].string_value, named["Command/Detail"].string_value)
                self.outcomes.setdefault(named["Command/Id"].string_value, []).append(outcome)
            if "Event" in named and named["Event"].string_value:
                self.events.append((cell, named["Event"].string_value))
            self.unordered += named["Record/Number"].timestamp < self.times.get(cell, 0)
            self.times[cell] = named["Record/Number"].timestamp

    def say(self, online, ahead=0):
        state = json.dumps({"online": online, "timestamp": int((time.time() + ahead) * 1000)})
        end = time.time() + 20
        while time.time() < end:
            try:
                message = self.client.publish(f"spBv1.0/STATE/{HOST}", state, qos=1, retain=True)
                message.wait_for_publish(5)
                if message.is_published():
                    return
            except (RuntimeError, ValueError):
                time.sleep(0.1)

    def command(self, cell, order, waits=True):
        payload = pb.Payload(timestamp=int(time.time() * 1000))
        payload.metrics.add(name="Command/Request", timestamp=payload.timestamp, datatype=12, string_value=json.dumps(order))
        message = self.client.publish(f"spBv1.0/{GROUP}/DCMD/{NODE}/{cell}", payload.SerializeToString(), qos=1)
        if waits:
            message.wait_for_publish(5)


broker_port, health_port = free_port(), free_port()
(folder / "mosquitto.conf").write_text(QUEUES.format(port=f"{broker_port} 127.0.0.1", folder=folder))


def start_broker():
    broker = spawn(["mosquitto", "-c", str(folder / "mosquitto.conf")], "broker.log", stderr=subprocess.STDOUT)

    def answers():
        try:
            socket.create_connection(("127.0.0.1", broker_port), 1).close()
            return True
        except OSError:
            return False

    wait("the broker", answers, 10)
    return broker


figure = lambda name: metrics(health_port).get(name, -1)
broker = start_broker()
proxy = Proxy(broker_port)
names = [(LINKS[index % len(LINKS)], index // len(LINKS) + 1) for index in range(args.cells)]
cells = [link(f"{link.NAME}-{number}", args.cellwire, folder, spawn) for link, number in names]
for cell in cells:
    wait(f"the simulator of {cell.name}", cell.ready, 20)
(folder / "site.toml").write_text(f"""\
[broker]
address = "127.0.0.1:{proxy.port}"
group = "{GROUP}"
node = "{NODE}"
primary_host = "{HOST}"
keep_alive = "5s"

[store]
file = "site.redb"

[health]
listen = "127.0.0.1:{health_port}"

""" + "\n".join(cell.table() for cell in cells))
start_bridge = lambda: spawn([BRIDGE, "--config", str(folder / "site.toml")], "bridge.log", stderr=subprocess.STDOUT)
bridge = start_bridge()
host = Host(broker_port)
host.say(True)
is_online = lambda: figure("online") == 1
wait("online", is_online, 20)
wait("every cell alive", lambda: all(host.alive.get(cell.name) for cell in cells), 20)


def restart():
    global broker
    broker.terminate()
    broker.wait()
    time.sleep(random.uniform(0, 4))
    broker = start_broker()
    wait("the consumer", host.client.is_connected, 20)
    host.say(True)


def cut():
    proxy.cut()
    wait("offline", lambda: not is_online(), 20)
    time.sleep(random.uniform(0, 4))
    proxy.restore()


def kill():
    """The bridge, as by the system when there is no memory left."""
    global bridge
    written[0] += of_process("io", "write_bytes")
    bridge.kill()
    bridge.wait()
    bridge = start_bridge()


def of_process(file, name):
    try:
        lines = Path(f"/proc/{bridge.pid}/{file}").read_text().splitlines()
        return next(int(line.split()[1]) for line in lines if line.startswith(f"{name}:"))
    except OSError:
        return 0


written = [0]


def leave():
    host.say(False)
    wait("offline with the host application", lambda: not is_online(), 20)
    time.sleep(random.uniform(0, 2))
    host.say(True)


def future():
    """A STATE that is dated a year ahead, and then what the host application says by the right clock."""
    host.say(False, ahead=365 * 86400)
    time.sleep(1)
    host.say(False)
    wait("offline with the host application", lambda: not is_online(), 20)
    host.say(True)


def frozen():
    """Every device stops for a while, and answers again. What is measured is from the answer to the last DBIRTH."""
    for cell in cells:
        cell.process.send_signal(signal.SIGSTOP)
    start, died = time.time(), {}
    while len(died) < len(cells) and time.time() < start + 45:
        for cell in cells:
            if host.alive[cell.name] is False:
                died.setdefault(cell.name, time.time() - start)
        time.sleep(0.05)
    print("  DDEATH after, in seconds:", ", ".join(f"{cell.NAME} {died.get(cell.name, float('inf')):.1f}" for cell in cells), flush=True)
    if len(died) < len(cells):
        fail("devices that do not answer are alive")
    for cell in cells:
        named = host.deaths.get(cell.name, {})
        own = {name: it for name, it in named.items() if name.split("/")[0] not in ("Record", "Command", "Link", "Event")}
        if not own or not all(it.is_null for it in own.values()) or "Event" not in named:
            fail(f"the death of {cell.name} has no null values with a reason: {list(named)}")
    for cell in cells:
        cell.process.send_signal(signal.SIGCONT)
    start, born = time.time(), {}
    while len(born) < len(cells) and time.time() < start + args.longest:
        for cell in cells:
            if host.alive[cell.name]:
                born.setdefault(cell.name, time.time() - start)
        time.sleep(0.05)
    print("  DBIRTH after, in seconds:", ", ".join(f"{cell.NAME} {born.get(cell.name, float('inf')):.1f}" for cell in cells), flush=True)
    return max((born.get(cell.name, float("inf")) for cell in cells))


def flood():
    """Far more commands for a cell than it takes, while it reports. What is measured is how long another one waits for its outcome."""
    flooded, other = (next(cell for cell in cells if cell.NAME == name) for name in ("fanuc-hmi-modbus", "mmacell-proto"))
    for number in range(2000):
        host.command(flooded.name, {"id": f"flood-{time.time()}-{number}", "write_register": {"address": 100, "value": 1}}, waits=False)
    start, id = time.time(), f"other-{time.time()}"
    host.command(other.name, {"id": id, "command": "SRV", "on": True})
    took = wait("the outcome of another cell's command", lambda: any(it[0] == "done" for it in host.outcomes.get(id, [])), args.longest)
    wait("the outcomes of a flood", lambda: sum(id.startswith("flood-") for id in host.outcomes) % 2000 == 0, 60)
    refused = sum(it[0] == "refused" for id, outcomes in host.outcomes.items() if id.startswith("flood-") for it in outcomes)
    print(f"  of 2000 commands for a cell {refused} are refused; another cell's is done after {took:.1f} s", flush=True)
    return took


FAULTS = {
    "restart": (restart, "the broker restarts"),
    "cut": (cut, "the network is cut"),
    "kill": (kill, "the bridge is killed"),
    "leave": (leave, "the host application goes and comes"),
    "future": (future, "a STATE dated a year ahead"),
    "flood": (flood, "2000 commands for one cell"),
    "frozen": (frozen, "every device stalls"),
}


def schedule():
    kinds = args.faults or list(FAULTS)
    if args.minutes is None:
        yield from (name for name in kinds for _ in range(1 if name in ("frozen", "future", "flood") else args.times))
        return
    for minute in range(args.minutes):
        print(f"{minute} min: {of_process('status', 'VmRSS')} KiB of memory", flush=True)
        yield kinds[minute % len(kinds)]
        time.sleep(max(0.0, began + (minute + 1) * 60 - time.time()))


began, took = time.time(), {}
for name in schedule():
    fault, what = FAULTS[name]
    back = fault()
    back = wait(f"back after {name}", is_online, args.longest) if back is None else back
    took.setdefault(what, []).append(back)
    print(f"  {what}: back after {back:.1f} s", flush=True)
    if back > args.longest:
        fail(f"{name}: back after {back} s")
    ended = [(cell.name, cell.process.returncode) for cell in cells if cell.process.poll() is not None]
    if ended:
        fail(f"simulators have ended, with {ended}")
    time.sleep(random.uniform(0, 1))
minutes, disk = (time.time() - began) / 60, written[0] + of_process("io", "write_bytes")
rows = [(what, len(times), max(times)) for what, times in took.items()]
host.say(True)
links_up = lambda: [value for name, value in metrics(health_port).items() if name.startswith("link_connected")]
if wait("online at the end", is_online, 60) < 60:
    for cell in cells:
        cell.stop()
    wait("every link down", lambda: (found := links_up()) and not any(found), 30)
    wait("an empty store", lambda: figure("store_records") == 0, 30)
last = metrics(health_port)
made = {cell.name: int(last.get(f'record_number{{cell="{cell.name}"}}', 0)) for cell in cells}
time.sleep(2)
lost = host.lost + sum(max(0, made[cell.name] - host.last.get(cell.name, 0)) for cell in cells)
print(f"\n{'fault':<38} {'times':>5} {'back after at most, s':>22}")
for what, times, worst in rows:
    print(f"{what:<38} {times:>5} {worst:>22.1f}")
print(f"\n{sum(made.values())} records: {lost} lost, {host.repeated} dropped by the rule of Record/Number, {host.unordered} older than the one "
      f"before; log of the bridge: {len((folder / 'bridge.log').read_text().splitlines())} lines")
print(f"the bridge: {of_process('status', 'VmHWM')} KiB of memory at the most, {disk / 1e6 / minutes:.1f} MB a minute written to the disk")
bridge.send_signal(signal.SIGTERM)
if bridge.wait() != 0:
    fail(f"the bridge ended with {bridge.returncode}")
if lost:
    fail(f"{lost} records are lost")
place.stop()
sys.exit(1 if failures else 0)
