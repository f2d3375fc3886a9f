"""Two bridges, each in a network of its own, that share cells at one broker: one dies, is cut off, both restart, and the broker
is. Commands with ids go to the cells all the time, and each device is asked afterwards what it has executed."""
import argparse
import atexit
import collections
import json
import random
import signal
import subprocess
import threading
import time
import uuid
from pathlib import Path

import paho.mqtt.client as mqtt
from ground import QUEUES, Ground
from links import LINKS
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.properties import Properties
from pysparkplug import _protobuf as pb

parser = argparse.ArgumentParser()
parser.add_argument("cellwire")
parser.add_argument("place", type=Path)
parser.add_argument("--times", type=int, default=1, help="each fault so often, of either bridge")
parser.add_argument("--minutes", type=int, help="a fault a minute, one kind after the other, for so long, while the bridges' clocks jump")
parser.add_argument("--longest", type=float, default=30, help="every cell is one bridge's again after so many seconds at the most")
parser.add_argument("faults", nargs="*", help="some of: kill, end, cut, stop, both, broker")
args = parser.parse_intermixed_args()
FAKETIME = "/usr/$LIB/faketime/libfaketime.so.1"  # the loader knows what $LIB is
NODES, BROKER, GROUP = ("bridge-1", "bridge-2"), "10.77.0.1", "site"
run = lambda *command, **options: subprocess.run(command, check=True, **options)


def networks(are_there):
    """Each bridge has a network of its own; the broker and the devices are on the other side of it, at an address that each has a way to."""
    for number, node in enumerate(NODES, 1):
        subprocess.run(["ip", "netns", "del", f"cw-{node}"], capture_output=True)
        subprocess.run(["ip", "link", "del", f"cw{number}"], capture_output=True)
    subprocess.run(["ip", "address", "del", f"{BROKER}/32", "dev", "lo"], capture_output=True)
    if not are_there:
        return
    run("ip", "address", "add", f"{BROKER}/32", "dev", "lo")
    for number, node in enumerate(NODES, 1):
        inside = ["ip", "netns", "exec", f"cw-{node}", "ip"]
        run("ip", "netns", "add", f"cw-{node}")
        run("ip", "link", "add", f"cw{number}", "type", "veth", "peer", "name", "lan", "netns", f"cw-{node}")
        run("ip", "address", "add", f"10.77.{number}.1/24", "dev", f"cw{number}")
        run("ip", "link", "set", f"cw{number}", "up")
        run(*inside, "address", "add", f"10.77.{number}.2/24", "dev", "lan")
        for link in ("lan", "lo"):
            run(*inside, "link", "set", link, "up")
        run(*inside, "route", "add", "default", "via", f"10.77.{number}.1")


networks(True)
atexit.register(networks, False)
ground = Ground(args.cellwire, args.place / "share", QUEUES)
# Links whose devices say which order they have executed.
ground.simulate(6, [link for link in LINKS if link.NAME in ("kawasaki-msg", "mmacell-proto")], listen=BROKER)
devices = {cell.name: cell for cell in ground.cells}


class Bridge:
    def __init__(self, node):
        self.node, self.site = node, ground.folder / f"{node}.toml"
        self.offset = ground.folder / f"{node}.clock"
        self.set_clock(0)
        tables = "\n".join(cell.table().replace("\nlink", "\nshared = true\nlink") for cell in ground.cells)
        self.site.write_text(f"""\
[broker]
address = "{BROKER}:{ground.broker_port}"
group = "{GROUP}"
node = "{node}"
keep_alive = "5s"
[store]
file = "{node}.redb"
[health]
listen = "127.0.0.1:9464"
[share]
bridges = {json.dumps(NODES)}
{tables}
""")
        self.start()

    def set_clock(self, seconds):
        """Its clock differs from this machine's by so much from now on; its monotonic clock runs on."""
        part = self.offset.with_suffix(".part")
        part.write_text(f"{seconds:+}")
        part.rename(self.offset)

    def start(self):
        command = [str(Path(args.cellwire).with_name("cellwire-bridge")), "--config", str(self.site)]
        if args.minutes:
            faked = {"LD_PRELOAD": FAKETIME, "FAKETIME_TIMESTAMP_FILE": self.offset, "FAKETIME_NO_CACHE": 1, "DONT_FAKE_MONOTONIC": 1,
                     "NO_FAKE_STAT": 1, "FAKETIME_DISABLE_SHM": 1}
            command = ["env", *(f"{name}={value}" for name, value in faked.items()), *command]
        self.process = ground.spawn(["ip", "netns", "exec", f"cw-{self.node}", *command], f"{self.node}.log", stderr=subprocess.STDOUT)

    def kill(self):
        self.process.kill()  # ip has become the bridge
        self.process.wait()

    def end(self):
        self.process.terminate()
        self.process.wait()

    def cut(self, change):
        """What it and the broker send one another is dropped (-A), or no more (-D); the devices are reached all the while."""
        for way, port in (("OUTPUT", "--dport"), ("INPUT", "--sport")):
            run("ip", "netns", "exec", f"cw-{self.node}", "iptables", change, way, "-p", "tcp", port, str(ground.broker_port), "-j", "DROP")

    def connected(self):
        """The cells whose devices it has a connection to."""
        found = subprocess.run(["ip", "netns", "exec", f"cw-{self.node}", "ss", "-tnH", "state", "established"], capture_output=True, text=True)
        peers = {line.split()[3] for line in found.stdout.splitlines() if len(line.split()) > 3}
        return {name for name, cell in devices.items() if cell.address in peers}


class Host:
    """Hears everything, knows by births and deaths where a cell is, and counts records by node, cell and store."""

    def __init__(self):
        self.lock, self.node, self.born = threading.Lock(), {}, collections.defaultdict(dict)
        self.last, self.lost, self.records, self.again = {}, 0, 0, 0
        self.outcomes, self.connections = collections.defaultdict(list), 0
        self.client = mqtt.Client("host", protocol=mqtt.MQTTv5)
        self.client.on_connect = self.connected
        self.client.on_message = self.take
        self.client.reconnect_delay_set(1, 1)
        properties = Properties(PacketTypes.CONNECT)
        properties.SessionExpiryInterval, properties.ReceiveMaximum = 3600, 65535
        self.client.connect("127.0.0.1", ground.broker_port, keepalive=10, clean_start=False, properties=properties)
        self.client.loop_start()

    def connected(self, client, *_):
        """Births have QoS 0: those of the time without a broker are asked for."""
        with self.lock:
            self.born.clear()
        self.connections += 1
        client.subscribe([(f"spBv1.0/{GROUP}/#", 1)])
        payload = pb.Payload(timestamp=int(time.time() * 1000))
        payload.metrics.add(name="Node Control/Rebirth", timestamp=payload.timestamp, datatype=11, boolean_value=True)
        for node in NODES:
            client.publish(f"spBv1.0/{GROUP}/NCMD/{node}", payload.SerializeToString(), qos=1)

    def take(self, _client, _data, message):
        _, _, kind, node, *cell = message.topic.split("/")
        if kind == "NDEATH":
            with self.lock:
                for nodes in self.born.values():
                    nodes.pop(node, None)
            return
        if kind not in ("DBIRTH", "DDATA", "DDEATH"):
            return
        payload, [cell] = pb.Payload.FromString(message.payload), cell
        named = {metric.name: metric for metric in payload.metrics}
        with self.lock:
            if kind == "DBIRTH":
                self.born[cell][node] = named["Link/Connected"].boolean_value
            elif kind == "DDEATH":
                self.born[cell].pop(node, None)
            else:
                number, last = named["Record/Number"].long_value, self.last.get((node, cell))
                if last is not None and number <= last:
                    self.again += 1
                    return
                self.lost += 0 if last is None else number - last - 1
                self.last[node, cell] = number
                self.records += 1
                if "Command/Id" in named:
                    outcome = (named["Command/Outcome"].string_value, node, named["Command/Detail"].string_value)
                    self.outcomes[named["Command/Id"].string_value].append(outcome)

    def places(self):
        with self.lock:
            return {cell: [node for node, alive in self.born[cell].items() if alive] for cell in devices}

    def command(self, node, cell, order):
        payload = pb.Payload(timestamp=int(time.time() * 1000))
        payload.metrics.add(name="Command/Request", timestamp=payload.timestamp, datatype=12, string_value=json.dumps(order))
        self.client.publish(f"spBv1.0/{GROUP}/DCMD/{node}/{cell}", payload.SerializeToString(), qos=1)


class Commander(threading.Thread):
    """Orders all the time, each id to both bridges and again later: whoever has the cell is to execute it, once."""

    def __init__(self):
        super().__init__(daemon=True)
        self.sent, self.stopped = {}, threading.Event()

    def run(self):
        number, late = 0, collections.deque()
        while not self.stopped.wait(0.25):
            number += 1
            cell = list(devices.values())[number % len(devices)]
            # A value says which command it was: the device reports it. A device that was let go has its servo off.
            moved, order = f"{cell.name}/{number}", ORDERS[cell.NAME](number)
            if cell.NAME == "mmacell-proto" and number // len(devices) % 3 == 0:
                moved, order = None, {"command": "SRV", "on": True}
            # Half of the ids have their time in them.
            id = f"{cell.name}/{number}" if number // len(devices) % 2 else uuid7()
            order = {"id": id, **order}
            # Most go to the bridge that has the cell, and some to both at once.
            nodes = sorted(NODES, key=lambda node: node not in host.places()[cell.name])
            host.command(nodes[0], cell.name, order)
            self.sent[id] = (cell.name, order, moved)
            if number % 4 == 0:
                host.command(nodes[1], cell.name, order)
            late.append((time.time() + random.uniform(1, 25), cell.name, order))
            while late and late[0][0] < time.time():
                _, name, order = late.popleft()
                for node in NODES:
                    host.command(node, name, order)

    def repeat(self):
        """Up to 200 earlier ones go to both again, each in another message with the time of now, as libraries do when they retry."""
        sent = list(self.sent.values())
        for cell, order, _ in random.sample(sent, min(200, len(sent))):
            for node in NODES:
                host.command(node, cell, order)


def uuid7():
    """A UUID of version 7, with the time of now."""
    return str(uuid.UUID(int=int(time.time() * 1000) << 80 | 7 << 76 | 2 << 62 | random.getrandbits(62)))


ORDERS = {
    "kawasaki-msg": lambda number: {"jobs": [{"kind": 1, "x1": number, "y1": 0, "x2": number, "y2": 1}]},
    "mmacell-proto": lambda number: {"command": "MOV", "mode": "absolute", "axes": [number, 0, 0, 0]},
}


def executed():
    """How often each order was executed, as the devices say it."""
    found = collections.Counter()
    for cell in ground.cells:
        if cell.NAME == "kawasaki-msg":
            lines = (ground.folder / f"{cell.name}.csv").read_text().splitlines()[1:]
            found.update(f"{cell.name}/{float(line.split(',')[3]):.0f}" for line in lines)
        else:
            events = map(json.loads, (ground.folder / cell.log).read_text().splitlines()[1:])
            found.update(f"{cell.name}/{event['to'][0]:.0f}" for event in events if event["event"] == "move")
    return found


class Watch(threading.Thread):
    """No device is ever connected to both bridges."""

    def __init__(self):
        super().__init__(daemon=True)
        self.looks, self.both, self.pause = 0, [], False

    def run(self):
        while True:
            common = bridges[0].connected() & bridges[1].connected()
            # One was looked at before the other: a cell that has changed sides in between is there still at the second look.
            if not self.pause and common and (common := common & bridges[0].connected() & bridges[1].connected()):
                self.both.append(common)
            self.looks += 1
            time.sleep(0.1)


class Clocks(threading.Thread):
    """Every some seconds the clock of a bridge jumps: to the right time, 25 s ahead or 25 s behind."""

    def __init__(self):
        super().__init__(daemon=True)
        self.jumps, self.stopped = 0, threading.Event()

    def run(self):
        while not self.stopped.wait(random.uniform(2, 20)):
            random.choice(bridges).set_clock(random.choice((-25, 0, 25)))
            self.jumps += 1


def settled(wanted):
    return lambda: host.places() == wanted


def whole(node=None):
    """Each cell is one bridge's; with a node, that one's."""
    places = host.places()
    return all(len(nodes) == 1 and node in (None, *nodes) for nodes in places.values())


def back(what, condition):
    start = time.time()
    ground.wait(what, condition, args.longest)
    took[what].append(time.time() - start)
    if commander.is_alive():
        commander.repeat()
    print(f"  {what}: after {took[what][-1]:.1f} s", flush=True)


def kill(at):
    bridges[at].kill()
    back("one is killed: the other has its cells", lambda: whole(NODES[1 - at]))
    time.sleep(3)
    bridges[at].start()
    back("it is there again, and has its cells", settled(shares))


def end(at):
    bridges[at].end()
    back("one is ended: the other has its cells", lambda: whole(NODES[1 - at]))
    bridges[at].start()
    back("it is there again, and has its cells", settled(shares))


def cut(at):
    bridges[at].cut("-A")
    back("one does not reach the broker: the other has its cells", lambda: whole(NODES[1 - at]))
    time.sleep(5)
    bridges[at].cut("-D")
    back("it reaches it again, and has its cells", settled(shares))


def stop(at):
    """Its process is stopped, and its connections with it, until the other has its cells."""
    watch.pause = True
    bridges[at].process.send_signal(signal.SIGSTOP)
    time.sleep(20)
    bridges[at].process.send_signal(signal.SIGCONT)
    back("one was stopped for 20 s, continues, and has its cells", settled(shares))
    watch.pause = False


def both(_):
    for bridge in bridges:
        bridge.kill()
    ground.wait("two deaths", lambda: not any(host.places().values()))
    for bridge in bridges:
        bridge.start()
    back("both are killed and started", settled(shares))


def broker(at):
    ground.broker.terminate()
    ground.broker.wait()
    time.sleep((1, 12)[at])
    before = host.connections
    ground.start_broker()
    back(f"the broker is away for {(1, 12)[at]} s", lambda: host.connections > before and settled(shares)())


def schedule():
    kinds, began = args.faults or list(FAULTS), time.time()
    if args.minutes is None:
        yield from ((name, at % 2) for name in kinds for at in range(2 * args.times))
        return
    for minute in range(args.minutes):
        print(f"{minute} min: {len(commander.sent)} commands, {host.records} records, {host.lost} lost, {clocks.jumps} jumps", flush=True)
        yield kinds[minute % len(kinds)], minute // len(kinds) % 2
        time.sleep(max(0.0, began + (minute + 1) * 60 - time.time()))


FAULTS = {"kill": kill, "end": end, "cut": cut, "stop": stop, "both": both, "broker": broker}
host = Host()
bridges = [Bridge(node) for node in NODES]
took = collections.defaultdict(list)
watch, commander, clocks = Watch(), Commander(), Clocks()
back("both are started", whole)
time.sleep(3)
shares = host.places()
if not whole() or len({node for [node] in shares.values()}) != 2:
    ground.fail(f"not shared: {shares}")
print("  " + ", ".join(f"{cell}: {node}" for cell, [node] in shares.items()), flush=True)
watch.start()
commander.start()
if args.minutes:
    clocks.start()
for name, at in schedule():
    FAULTS[name](at)
    time.sleep(random.uniform(1, 3))
clocks.stopped.set()
commander.stopped.set()
commander.join()
final = lambda id: [it for it in host.outcomes[id] if it[0] != "accepted"]


def all_final():
    """Those without an outcome are sent again: a command that no bridge has had is executed now."""
    missing = [id for id in commander.sent if not final(id)]
    for id in missing:
        for node in NODES:
            host.command(node, *commander.sent[id][:2])
    return not missing or time.sleep(2)


ground.wait("an outcome of every command", all_final)
time.sleep(3)
counts, wrong = executed(), []
for id, (_, _, moved) in commander.sent.items():
    if moved is None:
        continue
    outcomes = {outcome for outcome, *_ in final(id)}
    allowed = {1} if "done" in outcomes else {0, 1} if "unknown" in outcomes else {0}
    if counts[moved] not in allowed:
        wrong.append((id, counts[moved], host.outcomes[id]))
kinds = collections.Counter("done" if "done" in found else "unknown" if "unknown" in found else "refused"
                            for found in ({outcome for outcome, *_ in final(id)} for id in commander.sent))
unknown = [id for id, (_, _, moved) in commander.sent.items() if counts[moved] and not any(it[0] == "done" for it in final(id))]
print(f"\n{len(commander.sent)} commands, each sent three times at least, to both: {dict(kinds)}; executed {sum(counts.values())}, of "
      f"which {len(unknown)} are unknown; more than once: {sum(count > 1 for count in counts.values())}")
if args.minutes:
    print(f"{clocks.jumps} jumps of a bridge's clock, between 25 s behind and 25 s ahead")
print(f"{host.records} records, {host.lost} lost, {host.again} came again; {watch.looks} looks at the connections of the devices: "
      f"{len(watch.both)} with both bridges")
for what, times in took.items():
    print(f"{what:<60} {len(times):>3} times, {max(times):>5.1f} s at most")
if wrong or watch.both or host.lost:
    ground.fail(f"{wrong[:5]} {watch.both[:5]}")
ground.stop()
