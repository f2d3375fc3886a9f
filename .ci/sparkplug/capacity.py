"""How many cells a bridge carries: devices of all links in one light process, a broker, a consumer that counts, and nothing else."""
import argparse
import collections
import json
import os
import re
import subprocess
import threading
import time
from pathlib import Path

from ground import GROUP, Ground, metrics
from pysparkplug import _protobuf as pb

parser = argparse.ArgumentParser()
parser.add_argument("cellwire")
parser.add_argument("place", type=Path)
parser.add_argument("--cells", type=int, default=1000)
parser.add_argument("--minutes", type=float, default=1)
parser.add_argument("--longest", type=float, default=90, help="every cell is alive after so many seconds at the most")
args = parser.parse_args()
LOAD = Path(args.cellwire).with_name("examples") / "load"
SETTINGS = {
    "fanuc-hmi-modbus": 'poll = "100ms"', "kawasaki-msg": "", "laser-eb90": 'poll = "500ms"',
    "mmacell-proto": 'poll = "200ms", device = "platform"', "isra-ball": 'report = "200ms"',
    "val2-alter": 'report = "200ms"', "val2-viewer": "",
}
ground = Ground(args.cellwire, args.place / "capacity")
(ground.folder / "mosquitto.conf").write_text(
    f"listener {ground.broker_port} 127.0.0.1\nallow_anonymous true\nmax_inflight_messages 0\nmax_queued_messages 10000000\n")
ground.broker.kill()
ground.broker.wait()
ground.start_broker()
load = ground.spawn([str(LOAD)], "load.log")
ground.wait("the devices", lambda: "\n" in (ground.folder / "load.log").read_text())
places = json.loads((ground.folder / "load.log").read_text())
kinds = list(SETTINGS)
names = [f"{kinds[index % len(kinds)]}-{index}" for index in range(args.cells)]
ground.write_site("\n".join(
    f'[cell.{name}]\nlink = "{name.rsplit("-", 1)[0]}"\naddress = "{places[name.rsplit("-", 1)[0]]}"\n'
    f"settings = {{ {SETTINGS[name.rsplit('-', 1)[0]]} }}\n" for name in names))
# mosquitto_sub takes them; what is decoded is one in fifty, as the consumer is not what is measured.
consumer = subprocess.Popen(
    ["stdbuf", "-oL", "mosquitto_sub", "-V", "5", "-q", "1", "-D", "connect", "receive-maximum", "65535", "-h", "127.0.0.1",
     "-p", str(ground.broker_port), "-t", f"spBv1.0/{GROUP}/DDATA/#", "-F", "%t %x"], stdout=subprocess.PIPE, text=True)
ground.processes.append(consumer)
came, first, last, delays = collections.Counter(), {}, {}, []


def receive():
    for line in consumer.stdout:
        topic, _, payload = line.rstrip("\n").partition(" ")
        came[topic] += 1
        first.setdefault(topic, payload)
        last[topic] = payload
        if came[topic] % 50 == 0:
            found = pb.Payload.FromString(bytes.fromhex(payload))
            delays.append((time.time() * 1000 - found.metrics[0].timestamp, found.metrics[0].is_historical))


receiver = threading.Thread(target=receive, daemon=True)
receiver.start()
time.sleep(0.5)
ground.start_bridge()


figures = lambda: metrics(ground.health_port)
alive = lambda found: sum(value for name, value in found.items() if name.startswith("link_connected"))
links_up = lambda: collections.Counter(re.search(r'cell="(.*)-', name).group(1) for name, up in figures().items() if name.startswith("link_connected") and up)
begun, cpu = time.time(), lambda process: sum(map(int, Path(f"/proc/{process.pid}/stat").read_text().rsplit(")", 1)[1].split()[11:13])) / os.sysconf("SC_CLK_TCK")
while alive(figures()) < args.cells:
    if time.time() > begun + args.longest:
        busy = {name: f"{100 * cpu(it) / (time.time() - begun):.0f} %" for name, it in
                (("bridge", ground.bridge), ("devices", load), ("broker", ground.broker), ("consumer", consumer))}
        ground.fail(f"not every cell is alive after {args.longest:.0f} s: {dict(links_up())}; of one core: {busy}")
    time.sleep(1)
print(f"every cell is alive after {time.time() - begun:.0f} s", flush=True)
of = lambda file, name: int(re.search(rf"^{name}:\s+(\d+)", Path(f"/proc/{ground.bridge.pid}/{file}").read_text(), re.M).group(1))


def threads():
    """CPU of the bridge's threads by what they are for: those of the cells have the cells' names."""
    found = collections.Counter()
    for task in Path(f"/proc/{ground.bridge.pid}/task").iterdir():
        name = (task / "comm").read_text().strip()
        stat = (task / "stat").read_text().rsplit(")", 1)[1].split()
        kind = name if name in ("broker", "health", "signals") else "hub" if task.name == str(ground.bridge.pid) else "cells"
        found[kind] += (int(stat[11]) + int(stat[12])) / os.sysconf("SC_CLK_TCK")
    return found


time.sleep(5)
delays.clear()
before, begun, count = figures(), time.time(), sum(came.values())
used = {process: cpu(process) for process in (ground.bridge, load, ground.broker, consumer)}
parts, written = threads(), of("io", "write_bytes")
time.sleep(args.minutes * 60)
after, seconds, parts_after = figures(), time.time() - begun, threads()
share = lambda process: 100 * (cpu(process) - used[process]) / seconds
made = after["records_total"] - before["records_total"]
times = sorted(delay for delay, _ in delays)
at = lambda part: times[int(len(times) * part)] if times else float("nan")
switches = after["dropped_total{why=\"busy\"}"]
print(f"{args.cells} cells: {made / seconds:.0f} records/s made, {(after['acknowledged_total'] - before['acknowledged_total']) / seconds:.0f} "
      f"acknowledged, {(sum(came.values()) - count) / seconds:.0f} came; {alive(after):.0f} alive; {after['store_records']:.0f} wait; "
      f"{switches:.0f} dropped because the hub was busy")
print(f"  CPU of one core: bridge {share(ground.bridge):.0f} % ("
      + ", ".join(f"{kind} {100 * (parts_after[kind] - parts[kind]) / seconds:.0f} %" for kind in ("cells", "hub", "broker"))
      + f"), devices {share(load):.0f} %, broker {share(ground.broker):.0f} %, consumer {share(consumer):.0f} %")
print(f"  memory {of('status', 'VmHWM') / 1024:.0f} MiB, {of('status', 'Threads')} threads; delay median {at(0.5):.0f} ms, 99 % {at(0.99):.0f} ms; "
      f"disk {(of('io', 'write_bytes') - written) / 1e6 / (seconds / 60):.1f} MB a minute")
if alive(after) < args.cells or switches:
    ground.fail("not all of it was carried")
# The bridge ends, and has nothing left; then each cell has sent as many records as its numbers have gone on.
ground.bridge.terminate()
ground.bridge.wait()
time.sleep(2)
consumer.terminate()
receiver.join(10)


def number(text):
    payload = pb.Payload.FromString(bytes.fromhex(text))
    return next(metric.long_value for metric in payload.metrics if metric.name == "Record/Number")


lost = {topic: number(last[topic]) - number(first[topic]) + 1 - count for topic, count in came.items()}
print(f"  by Record/Number, of {sum(came.values())} records: {sum(max(0, count) for count in lost.values())} lost, "
      f"{sum(max(0, -count) for count in lost.values())} twice; {len(came)} cells")
if any(lost.values()) or len(came) != args.cells:
    ground.fail({topic: count for topic, count in lost.items() if count})
ground.stop()
