"""A site: simulated cells, the bridge, a broker that is killed, and a consumer that counts."""
import argparse
import json
import os
import re
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

from consumer import STATEMENTS, Consumer
from ground import Place, free_port, metrics
from links import LINKS

parser = argparse.ArgumentParser()
parser.add_argument("cellwire")
parser.add_argument("place", type=Path)
parser.add_argument("--cells", type=int, default=7)
parser.add_argument("--minutes", type=float, default=1 / 3)
parser.add_argument("--qos", type=int, default=1, help="0: Sparkplug's statements to the letter; then a killed broker loses records")
parser.add_argument("--aliases", action="store_true", help="numbers stand for the names of metrics")
parser.add_argument("--mqtt", default="5", choices=["5", "3.1.1"], help="the bridge's version of MQTT; 3.1.1 does not say what is refused")
parser.add_argument("--websocket", action="store_true", help="the bridge reaches its broker over a WebSocket: it is built with that feature")
parser.add_argument("--calm", action="store_true", help="kill nobody")
parser.add_argument("--link", choices=[link.NAME for link in LINKS], help="cells of this link only")
parser.add_argument("--alone", action="store_true", help="the bridge has the last processor for itself")
args = parser.parse_args()
links = [link for link in LINKS if args.link in (None, link.NAME)]
processors = sorted(os.sched_getaffinity(0))
if args.alone:
    os.sched_setaffinity(0, processors[:-1])
BRIDGE = str(Path(args.cellwire).with_name("cellwire-bridge"))
LOGIN, GROUP, NODE, HOST = ("bridge", "correct horse"), "site", "bridge-1", "scada"
COMMANDER, DASHBOARD = (HOST, "battery"), ("dashboard", "staple")
PAGE = Path(__file__).parents[2] / "docs/bridge.md"
folder = args.place / "run"
place = Place(folder)
wait, fail, spawn = place.wait, place.fail, place.spawn


def certificates():
    run = lambda *command: subprocess.run(command, cwd=folder, check=True, capture_output=True)
    run("openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2", "-subj", "/CN=site authority",
        "-keyout", "ca.key", "-out", "ca.pem")
    run("openssl", "req", "-newkey", "rsa:2048", "-nodes", "-subj", "/CN=localhost", "-keyout", "broker.key", "-out", "broker.csr")
    (folder / "names").write_text("subjectAltName=DNS:localhost\n")
    run("openssl", "x509", "-req", "-in", "broker.csr", "-CA", "ca.pem", "-CAkey", "ca.key", "-CAcreateserial", "-days", "2",
        "-extfile", "names", "-out", "broker.pem")
    run("mosquitto_passwd", "-b", "-c", str(folder / "passwords"), *LOGIN)
    for login in (COMMANDER, DASHBOARD):
        run("mosquitto_passwd", "-b", str(folder / "passwords"), *login)
    (folder / "bridge.password").write_text(LOGIN[1] + "\n")
    (folder / "bridge.password").chmod(0o600)


os.environ["PATH"] += ":/usr/sbin"
tls_port, plain_port = free_port(), free_port()
certificates()
(folder / "mosquitto.conf").write_text(f"""\
user root
listener {tls_port} 127.0.0.1
cafile {folder}/ca.pem
certfile {folder}/broker.pem
keyfile {folder}/broker.key
listener {plain_port} 127.0.0.1
allow_anonymous false
password_file {folder}/passwords
acl_file {folder}/access
max_inflight_messages 0
max_queued_messages 10000000
persistence true
persistence_location {folder}/
autosave_interval 0
""")


def access(*forbidden):
    """Who may do what: as the page has it, but with these cells' topics."""
    rules = next(block for block in PAGE.read_text().split("```text\n") if block.startswith("user ")).split("```")[0]
    denied = "".join(f"topic deny spBv1.0/{GROUP}/+/{NODE}/{cell.name}\n" for cell in forbidden)
    (folder / "access").write_text(rules.replace(f"user {LOGIN[0]}\n", f"user {LOGIN[0]}\n{denied}"))


def start_broker():
    """It writes its sessions at SIGTERM only, and has nothing after a SIGKILL: not what an earlier end has left either."""
    broker = spawn(["mosquitto", "-c", str(folder / "mosquitto.conf")], "broker.log", stderr=subprocess.STDOUT)

    def answers():
        if broker.poll() is not None:
            fail("the broker has ended")
        try:
            socket.create_connection(("127.0.0.1", plain_port), 1).close()
            return True
        except OSError:
            return False

    wait("the broker", answers)
    (folder / "mosquitto.db").unlink(missing_ok=True)
    return broker


class Bridge:
    def __init__(self, site):
        self.site, self.cpu, self.most, self.written = site, 0.0, 0, 0
        self.start()

    def start(self):
        self.began = time.time()
        place = ["taskset", "-c", str(processors[-1])] if args.alone else []
        self.process = spawn([*place, BRIDGE, "--config", str(self.site)], "bridge.log", stderr=open(folder / "bridge.err", "a"))

    def look(self):
        try:
            stat = Path(f"/proc/{self.process.pid}/stat").read_text().rsplit(")", 1)[1].split()
            status = Path(f"/proc/{self.process.pid}/status").read_text()
        except OSError:
            return 0.0
        memory = re.search(r"VmHWM:\s+(\d+)", status)
        self.most = max(self.most, int(memory.group(1)) if memory else 0)
        return (int(stat[11]) + int(stat[12])) / os.sysconf("SC_CLK_TCK")

    def disk(self):
        """Bytes that it has had the system write to the disk."""
        try:
            return int(re.search(r"^write_bytes: (\d+)", Path(f"/proc/{self.process.pid}/io").read_text(), re.M).group(1))
        except (OSError, AttributeError):
            return 0

    def kill(self, number):
        self.cpu += self.look()
        self.written += self.disk()
        self.process.send_signal(number)
        self.process.wait()


def figure(name):
    return metrics(health_port).get(name, -1)


def books():
    """Records made since the bridge began, less those that the broker or the store has: always the same, or the bridge has lost some."""
    found = metrics(health_port)
    return found["records_total"] - found["acknowledged_total"] - found["store_records"] - sum(
        value for name, value in found.items() if "dropped_total" in name and "busy" not in name)


health_port, websocket_port = free_port(), free_port()
if args.websocket:
    # Debian's mosquitto has none.
    script = Path(__file__).with_name("websocket.py")
    spawn([sys.executable, script, str(websocket_port), folder / "broker.pem", folder / "broker.key", str(plain_port)], "websocket.log")
cells = []
for index in range(args.cells):
    link = links[index % len(links)]
    cells.append(link(f"{link.NAME}-{index // len(links) + 1}", args.cellwire, folder, spawn))
for cell in cells:
    wait(f"the simulator of {cell.name}", cell.ready)
site = folder / "site.toml"
site.write_text(f"""\
[broker]
address = "{f'wss://localhost:{websocket_port}/mqtt' if args.websocket else f'localhost:{tls_port}'}"
group = "{GROUP}"
node = "{NODE}"
user = "{LOGIN[0]}"
password_file = "bridge.password"
tls = {{ ca = "ca.pem" }}
primary_host = "{HOST}"
qos = {args.qos}
aliases = {str(args.aliases).lower()}
mqtt = "{args.mqtt}"

[store]
file = "site.redb"

[health]
listen = "127.0.0.1:{health_port}"

""" + "\n".join(cell.table() for cell in cells))
checked = subprocess.run([BRIDGE, "--config", str(site), "--check"], capture_output=True, text=True)
if checked.returncode != 0:
    fail(checked.stderr)

# One that reports all the time. Nobody learns what becomes of a message with QoS 0.
forbidden = [cell for cell in cells if cell.NAME != "kawasaki-msg"][:1] if args.qos == 1 and args.mqtt == "5" else []
access(*forbidden)
broker = start_broker()
bridge = Bridge(site)
consumer = Consumer("127.0.0.1", plain_port, COMMANDER, GROUP, NODE, HOST, args.qos)
consumer.refusing = bool(forbidden)
started = time.time()
# Without the host application nothing is sent.
wait("records in the store", lambda: figure("store_records") > args.cells)
if figure("published_total") != 0:
    fail("records were published without the host application")
consumer.start()
place.processes.append(consumer.receiver)
wait("online", lambda: figure("online") == 1)
wait("a record of every cell", lambda: len(consumer.accepted) == args.cells - len(forbidden))

# A cell that the broker refuses is held; a minute's trial, or that of a connection, finds that it is taken.
held = [f'held_records{{cell="{cell.name}"}}' for cell in forbidden]
wait("records that are held", lambda: all(figure(name) > 3 for name in held))
access()
broker.send_signal(signal.SIGHUP)
if args.minutes >= 1:
    wait("the trial of a minute", lambda: all(figure(name) == 0 for name in held), 90)
consumer.go_offline()
wait("offline with the host application", lambda: figure("online") == 0)
consumer.go_online()
wait("online again", lambda: figure("online") == 1)
wait("nothing held", lambda: all(figure(name) == 0 for name in held))
wait("a record of every cell", lambda: len(consumer.accepted) == args.cells)
wait("births after a hole", lambda: not consumer.hole)
consumer.refusing = False

end = started + args.minutes * 60
length = args.minutes * 60

(folder / "command.py").write_text(PAGE.read_text().split("```python\n")[1].split("```")[0])


def commands(round):
    """Orders something from each cell that takes commands, each id twice, by the page's command.py."""
    sent = {}
    for cell in cells:
        for id, order, wanted in cell.orders(round):
            command = [sys.executable, folder / "command.py", json.dumps({"id": id, **order})]
            payload = subprocess.run(command, check=True, stdout=subprocess.PIPE).stdout
            consumer.send(cell.name, payload)
            consumer.send(cell.name, payload)
            sent[id] = (cell, wanted)
    final = lambda id: [it for it in consumer.outcome(id) if it != "accepted"]
    wait("outcomes of commands", lambda: all(final(id) for id in sent), 60)
    time.sleep(1)
    for id, (cell, wanted) in sent.items():
        found = final(id)
        if set(found) != {wanted}:
            fail(f"command {id} of {cell.name}: {consumer.outcome(id)} ({consumer.values.get(id)}), expected {wanted}")
    return len(sent)


# Who may only look orders nothing.
looker = Consumer("127.0.0.1", plain_port, DASHBOARD, GROUP, NODE, HOST, args.qos)
looker.look()
accepted = figure('commands_total{outcome="accepted"}')
looker.command(cells[0].name, {"id": "looker", **cells[0].orders(1)[0][1]})
looker.client.publish(f"spBv1.0/STATE/{HOST}", looker.state(False), qos=1, retain=True)
time.sleep(2)
if consumer.outcome("looker") or figure('commands_total{outcome="accepted"}') != accepted or figure("online") != 1:
    fail("a dashboard has ordered something")
looker.client.disconnect()
ordered = commands(1)
consumer.ask_rebirth()
wait("a rebirth", lambda: consumer.rebirth is None)
# A broker that is ended by SIGTERM has to lose nothing, also while the bridge is killed; one that is killed loses what it has not
# handed on.
outages, killed, lengths = 0, [], []
if not args.calm:
    ends = [signal.SIGKILL, signal.SIGTERM, signal.SIGKILL, signal.SIGKILL]
    for outage, end_of_broker in enumerate(ends):
        if end_of_broker == signal.SIGTERM:
            slow = [(cell, *cell.slow_order()) for cell in cells if cell.slow_order()]
            for cell, id, order in slow:
                consumer.command(cell.name, {"id": id, **order})
            wait("slow commands", lambda: all(consumer.outcome(id) == ["accepted"] for _, id, _ in slow), 20)
        before = time.time()
        broker.send_signal(end_of_broker)
        broker.wait()
        outages += 1
        if end_of_broker == signal.SIGKILL:
            killed.append((before, time.time() + 1))
        time.sleep(min(10, length / 15))
        if end_of_broker == signal.SIGTERM:
            bridge.kill(signal.SIGKILL)
            time.sleep(0.5)
            bridge.start()
            time.sleep(1)
        balance = books()
        lengths.append(figure("store_bytes") / max(1, figure("store_records")))
        broker = start_broker()
        wait("online again", lambda: figure("online") == 1)
        if end_of_broker == signal.SIGTERM:
            # What the bridge was killed over is unknown, and is not executed by being asked for again.
            wait("unknown outcomes", lambda: all(consumer.outcome(id)[-1] == "unknown" for _, id, _ in slow))
            for cell, id, order in slow:
                consumer.command(cell.name, {"id": id, **order})
            wait("the same outcomes", lambda: all(consumer.outcome(id)[-2:] == ["unknown"] * 2 for _, id, _ in slow))
            ordered += len(slow)
        time.sleep(max(1.0, (end - time.time()) / (len(ends) + 1 - outage) - 10 if length > 60 else 1.0))
    ordered += commands(2)
time.sleep(max(0.0, end - time.time()))
# No new records, then everything that waits.
for cell in cells:
    cell.stop()
links_up = lambda: [value for name, value in metrics(health_port).items() if name.startswith("link_connected")]
wait("every link down", lambda: (found := links_up()) and not any(found))
wait("an empty store", lambda: figure("store_records") == 0)
seconds = time.time() - started
last = metrics(health_port)
if not args.calm and books() != balance:
    fail(f"the bridge's books: {balance} and then {books()}: {last}")
cpu = bridge.cpu + bridge.look()
megabytes = (bridge.written + bridge.disk()) / 1e6 / (seconds / 60)
bridge.kill(signal.SIGINT)
if bridge.process.returncode != 0:
    fail(f"the bridge ended with {bridge.process.returncode}")
wait("the death of the node", lambda: consumer.bd is None)
consumer.stop()
for cell in cells:
    cell.verify(1 if args.calm else 2, fail)
place.stop()

print(f"{args.cells} cells, {seconds:.0f} s, QoS {args.qos}, TLS; the broker was ended {outages - len(killed)} times and killed "
      f"{len(killed)} times, the bridge killed {0 if args.calm else 1} times; {ordered} commands, each sent twice\n")
row = "{:<18} {:>9} {:>9} {:>6}".format
print(row("cell", "out", "in", "lost"))
out_all = in_all = lost_all = 0
kinds = {}
for cell in cells:
    # A link that is retried makes records up to the end: what the bridge had, or what came after that.
    highest = max((number for (name, _), number in consumer.last.items() if name == cell.name), default=0)
    out = max(int(last[f'record_number{{cell="{cell.name}"}}']), highest)
    got = consumer.accepted[cell.name]
    total = kinds.setdefault(cell.NAME, [0, 0, 0])
    total[0] += out
    total[1] += got
    total[2] += out - got
for name, (out, got, lost) in kinds.items():
    print(row(name, out, got, lost))
    out_all, in_all, lost_all = out_all + out, in_all + got, lost_all + lost
print(row("all", out_all, in_all, lost_all))
delays = sorted(consumer.delays)
at = lambda part: f"{delays[int(len(delays) * part)]:.0f}" if delays else "-"
# Over a SIGKILL: its neighbours came before and after it, and by the bridge's books the broker had acknowledged it.
of_broker = sum(to - first + 1 for _, first, to, before, after in consumer.gaps
                if any(before <= end and after >= start for start, end in killed))
print(f"\nlost by the bridge: {lost_all - of_broker}; acknowledged and lost by the broker that was killed: {of_broker}")
print(f"repeated by the sequence: 0 (the rule of Record/Number; {consumer.repeated} copies of the bridge's and {consumer.again} of the "
      "broker's, as QoS 1 has them, were dropped)")
print(f"kept while away (is_historical): {consumer.historical}; delay of the others: median {at(0.5)} ms, 99 % {at(0.99)} ms")
print(f"messages {consumer.messages}, the consumer's connections {consumer.connections}, NBIRTH {consumer.nbirths}, DBIRTH {consumer.dbirths}, NDEATH {consumer.deaths}")
print(f"the bridge: {cpu:.1f} s of CPU, {100 * cpu / seconds:.1f} % of one core, {bridge.most / 1024:.1f} MiB at most, "
      f"{out_all / seconds:.0f} records/s")
print(f"the disk: {megabytes:.1f} MB a minute; " + (f"{max(lengths):.0f} bytes a record that waits\n" if lengths else "nothing has waited\n"))
bad = 0
for statement, what in STATEMENTS.items():
    failures = consumer.failures.get(statement, [])
    bad += len(failures)
    differs = statement == "topics-ddata-mqtt" and args.qos == 1
    if "alias" in statement and not args.aliases:
        continue
    word = "fails" if failures else "differs" if differs else "holds"
    print(f"{word:<7} {consumer.counts[statement]:>7}  tck-id-{statement}: {what}")
    for failure in failures[:3]:
        print(f"         {failure}")
unchecked = [statement for statement in STATEMENTS if not consumer.counts[statement] and (args.aliases or "alias" not in statement)]
if args.qos == 1 and lost_all != of_broker:
    fail(f"lost: {consumer.gaps}")
if max(lengths, default=0) > 300 or args.minutes >= 1 and megabytes > args.cells / 10:
    fail(f"the disk: {megabytes:.1f} MB a minute, {lengths} bytes a record")
if bad or unchecked:
    fail(f"{bad} breaches of the specification; never checked: {unchecked}")
print("\ndone")
