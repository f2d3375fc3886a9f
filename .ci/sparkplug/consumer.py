"""A host application that did not come from us: decodes with pysparkplug's classes and checks what it may expect.

It counts records by their numbers alone, as docs/bridge.md tells a consumer to, and checks Sparkplug's statements on topics,
payloads, births, deaths and sequence numbers, each by the id that the specification gives it.

mosquitto_sub receives, with a session that outlives its connection; paho publishes the host's STATE and the commands.
"""
import collections
import json
import subprocess
import threading
import time

import paho.mqtt.client as mqtt
from paho.mqtt.packettypes import PacketTypes
from paho.mqtt.properties import Properties
from pysparkplug import _protobuf as pb

STATEMENTS = {
    "topic-structure-namespace-a": "every topic begins with spBv1.0",
    "topics-nbirth-topic": "NBIRTH goes to GROUP/NBIRTH/NODE",
    "topics-nbirth-mqtt": "NBIRTH has QoS 0 and is not retained",
    "payloads-nbirth-seq": "NBIRTH has sequence number 0",
    "topics-nbirth-timestamp": "NBIRTH has a timestamp",
    "topics-nbirth-bdseq-included": "NBIRTH has bdSeq, an Int64 from 0 to 255",
    "topics-nbirth-bdseq-increment": "bdSeq goes on at every connection, also of a bridge that was killed",
    "topics-nbirth-rebirth-metric": "NBIRTH has Node Control/Rebirth, a Boolean that is false",
    "topics-nbirth-metrics": "every metric of NBIRTH has name, datatype and value",
    "topics-ndeath-payload": "NDEATH has the metric bdSeq and no other",
    "topics-ndeath-seq": "NDEATH has no sequence number",
    "topics-nbirth-bdseq-matching": "bdSeq of NDEATH is that of the NBIRTH before it",
    "message-flow-edge-node-birth-publish-will-message-qos": "the will is delivered with QoS 1",
    "topics-dbirth-topic": "DBIRTH goes to GROUP/DBIRTH/NODE/DEVICE",
    "topics-dbirth-mqtt": "DBIRTH has QoS 0 and is not retained",
    "topics-dbirth-timestamp": "DBIRTH has a timestamp",
    "topics-dbirth-metrics": "every metric of DBIRTH has name, datatype, and a value or is_null",
    "message-flow-device-birth-publish-nbirth-wait": "no DBIRTH before NBIRTH",
    "topics-ddata-topic": "DDATA goes to GROUP/DDATA/NODE/DEVICE",
    "topics-ddata-mqtt": "DDATA has QoS 0 (with qos = 0 in the site file; by default it has 1) and is not retained",
    "topics-ddata-timestamp": "DDATA has a timestamp",
    "payloads-name-birth-data-requirement": "every metric of DDATA was in DBIRTH, with the same datatype",
    "topics-dbirth-metric-reqs": "no DDATA of a device without DBIRTH",
    "payloads-metric-timestamp-in-UTC": "every metric has a timestamp in milliseconds since 1970",
    "operational-behavior-data-publish-dbirth-order": "metrics that are not historical come in the order of their times",
    "payloads-sequence-num-incrementing": "each message has the number after the one before, 0 after 255",
    "payloads-alias-uniqueness": "no two metrics of the node have the same alias",
    "payloads-alias-data-cmd-requirement": "with aliases DDATA has those of DBIRTH, and no names",
    "topics-ddeath-mqtt": "DDEATH has QoS 0 and is not retained",
    "topics-ddeath-seq-num": "DDEATH has a sequence number",
    "operational-behavior-data-commands-rebirth-action-3": "after Rebirth: NBIRTH and every DBIRTH, with the same bdSeq",
    "message-flow-edge-node-birth-publish-phid-wait": "nothing before the primary host application is online",
}
VALUES = ("int_value", "long_value", "float_value", "double_value", "boolean_value", "string_value")


# So many messages are remembered: more than a broker may have on their way to a client.
RECENT = 70_000
# What the host's going offline may take to reach the bridge, in milliseconds.
SLACK = 1000

Message = collections.namedtuple("Message", "topic qos retain payload")


class Consumer:
    def __init__(self, host, port, login, group, node, host_id, qos):
        self.group, self.node, self.host_id, self.qos = group, node, host_id, qos
        self.lock = threading.Lock()
        self.counts, self.failures = collections.Counter(), collections.defaultdict(list)
        self.last = {}  # (cell, store): the highest number
        self.accepted, self.repeated, self.historical = collections.Counter(), 0, 0
        self.arrived = {}  # (cell, store): when its last record came
        self.gaps = []  # (key, first, last, when the record before came, when the one after)
        self.recent, self.order, self.again = set(), collections.deque(), 0
        self.outcomes = collections.defaultdict(list)
        self.events, self.values = [], {}
        self.store, self.messages, self.delays = {}, 0, []
        self.aliases = {}  # of each cell, since its birth: the metric that each stands for
        self.newest = None  # the bdSeq of the last birth
        self.births, self.bd, self.seq, self.nbirths, self.dbirths, self.deaths = {}, None, None, 0, 0, 0
        self.rebirth = None  # the bdSeq at a request
        self.refusing, self.hole = False, False  # what the broker refuses leaves a hole, which lasts until the next NBIRTH
        self.online = []  # [from, to]: when the host was online, in milliseconds since 1970
        self.subscribed, self.connections = threading.Event(), 0
        self.client = mqtt.Client("host", protocol=mqtt.MQTTv5)
        self.client.username_pw_set(*login)
        self.client.on_connect, self.client.on_disconnect = self.connected, self.disconnected
        self.client.reconnect_delay_set(1, 1)
        self.place, self.login = (host, port), login
        self.stamp()

    def stamp(self):
        self.timestamp = int(time.time() * 1000)
        self.client.will_set(f"spBv1.0/STATE/{self.host_id}", self.state(False), qos=1, retain=True)

    def state(self, online):
        return json.dumps({"online": online, "timestamp": self.timestamp})

    def start(self):
        (host, port), (user, password) = self.place, self.login
        topics = [f"spBv1.0/{self.group}/{kind}/#" for kind in ("NBIRTH", "NDEATH", "DBIRTH", "DDATA", "DDEATH", "NDATA")]
        # With fewer messages on their way than wait, births, which have QoS 0, would overtake records.
        command = ["stdbuf", "-oL", "mosquitto_sub", "-d", "-V", "5", "-q", "1", "-c", "-i", "consumer", "-x", "3600", "-k", "10",
                   "-D", "connect", "receive-maximum", "65535", "-h", host, "-p", str(port), "-u", user, "-P", password,
                   "-F", "%t %q %r %x", *(word for topic in topics for word in ("-t", topic))]
        self.receiver = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True)
        threading.Thread(target=self.receive, daemon=True).start()
        self.client.connect(host, port, keepalive=10, clean_start=True)
        self.client.loop_start()

    def look(self):
        """Connects under another name, without the host application and its will."""
        self.client = mqtt.Client("looker", protocol=mqtt.MQTTv5)
        self.client.username_pw_set(*self.login)
        self.client.connect(*self.place)
        self.client.loop_start()

    def stop(self):
        self.client.disconnect()
        self.client.loop_stop()
        self.receiver.kill()
        self.receiver.wait()

    def receive(self):
        for line in self.receiver.stdout:
            words = line.rstrip("\n").split(" ")
            if words[0].startswith("spBv1.0/"):
                message = Message(words[0], int(words[1]), words[2] == "1", bytes.fromhex(words[3]))
                with self.lock:
                    self.take(message)
            elif line.startswith("Subscribed"):
                self.connections += 1
                self.subscribed.set()

    def connected(self, client, *_):
        # The receiver waits a second before it connects again, and is to miss no birth.
        threading.Thread(target=lambda: self.subscribed.wait() and self.go_online(self.timestamp), daemon=True).start()

    def disconnected(self, *_):
        self.subscribed.clear()
        self.close_period()
        self.stamp()

    def go_online(self, timestamp=None):
        self.timestamp = timestamp or int(time.time() * 1000)
        with self.lock:
            self.online.append([int(time.time() * 1000), None])
        self.client.publish(f"spBv1.0/STATE/{self.host_id}", self.state(True), qos=1, retain=True)

    def go_offline(self):
        self.timestamp = int(time.time() * 1000)
        self.close_period()
        self.client.publish(f"spBv1.0/STATE/{self.host_id}", self.state(False), qos=1, retain=True)

    def close_period(self):
        with self.lock:
            if self.online and self.online[-1][1] is None:
                self.online[-1][1] = int(time.time() * 1000)

    def check(self, statement, holds, what=""):
        self.counts[statement] += 1
        if not holds and len(self.failures[statement]) < 5:
            self.failures[statement].append(str(what)[:200])
        elif not holds:
            self.failures[statement].append("…")

    def is_again(self, message):
        """Whether the broker sends again what it did not see acknowledged. What the bridge sends again has another `seq`."""
        if message in self.recent:
            self.again += 1
            return True
        self.recent.add(message)
        self.order.append(message)
        if len(self.order) > RECENT:
            self.recent.discard(self.order.popleft())
        return False

    def take(self, message):
        if message.qos == 1 and self.is_again(message):
            return
        levels = message.topic.split("/")
        self.messages += 1
        check = self.check
        check("topic-structure-namespace-a", levels[0] == "spBv1.0" and levels[1] == self.group, message.topic)
        kind = levels[2]
        payload = pb.Payload.FromString(message.payload)
        plain = not message.retain
        if kind != "NDEATH":
            was_online = any(start <= payload.timestamp and (end is None or payload.timestamp <= end + SLACK)
                             for start, end in self.online)
            check("message-flow-edge-node-birth-publish-phid-wait", was_online, f"{message.topic} at {payload.timestamp}")
            goes_on = kind == "NBIRTH" or self.seq is None or payload.seq == (self.seq + 1) % 256
            self.hole = kind != "NBIRTH" and (self.hole or not goes_on)
            check("payloads-sequence-num-incrementing",
                  payload.HasField("seq") and 0 <= payload.seq <= 255 and (goes_on or self.refusing),
                  f"{message.topic}: {payload.seq} after {self.seq}")
            self.seq = payload.seq
        if kind == "DDATA":
            aliases = self.aliases.get(levels[4], {})
            for metric in payload.metrics:
                if metric.HasField("alias"):
                    check("payloads-alias-data-cmd-requirement", metric.alias in aliases and not metric.name, metric)
                    metric.name = aliases.get(metric.alias, "")
        for metric in payload.metrics:
            check("payloads-metric-timestamp-in-UTC", 1.6e12 < metric.timestamp < 2.5e12, metric.timestamp)
        if kind == "NBIRTH":
            self.nbirth(message, payload, plain, levels)
        elif kind == "NDEATH":
            self.ndeath(message, payload)
        elif kind == "DBIRTH":
            self.dbirths += 1
            check("topics-dbirth-topic", levels[3] == self.node and len(levels) == 5, message.topic)
            check("topics-dbirth-mqtt", message.qos == 0 and plain, message.qos)
            check("topics-dbirth-timestamp", payload.HasField("timestamp"))
            check("message-flow-device-birth-publish-nbirth-wait", self.bd is not None, message.topic)
            for metric in payload.metrics:
                has = metric.is_null or metric.WhichOneof("value") in VALUES
                check("topics-dbirth-metrics", metric.name and metric.datatype and has, metric)
            self.aliases[levels[4]] = {metric.alias: metric.name for metric in payload.metrics if metric.HasField("alias")}
            known = [alias for aliases in self.aliases.values() for alias in aliases]
            if known:
                check("payloads-alias-uniqueness", len(known) == len(set(known)), known)
            self.births[levels[4]] = {metric.name: metric.datatype for metric in payload.metrics}
            self.store[levels[4]] = next(m.string_value for m in payload.metrics if m.name == "Record/Store")
        elif kind == "DDATA":
            self.ddata(message, payload, plain, levels)
        elif kind == "DDEATH":
            check("topics-ddeath-mqtt", message.qos == 0 and plain, message.qos)
            check("topics-ddeath-seq-num", payload.HasField("seq"))
            self.births.pop(levels[4], None)
        else:
            self.failures["topic"].append(message.topic)

    def nbirth(self, message, payload, plain, levels):
        check = self.check
        self.nbirths += 1
        check("topics-nbirth-topic", levels[3:] == [self.node], message.topic)
        check("topics-nbirth-mqtt", message.qos == 0 and plain, message.qos)
        check("payloads-nbirth-seq", payload.seq == 0, payload.seq)
        check("topics-nbirth-timestamp", payload.HasField("timestamp"))
        named = {metric.name: metric for metric in payload.metrics}
        bd = named.get("bdSeq")
        check("topics-nbirth-bdseq-included", bd is not None and bd.datatype == 4 and 0 <= bd.long_value <= 255)
        rebirth = named.get("Node Control/Rebirth")
        check("topics-nbirth-rebirth-metric", rebirth is not None and rebirth.datatype == 11 and not rebirth.boolean_value)
        for metric in payload.metrics:
            check("topics-nbirth-metrics", metric.name and metric.datatype and metric.WhichOneof("value"), metric)
        if self.rebirth is not None:
            check("operational-behavior-data-commands-rebirth-action-3", bd.long_value == self.rebirth, bd)
            self.rebirth = None
        elif self.newest is not None:
            # A connection that never came to a birth has used up a number of its own; births after a refusal have the connection's.
            steps = (bd.long_value - self.newest) % 256
            check("topics-nbirth-bdseq-increment", (0 if self.refusing else 1) <= steps < 128, (self.newest, bd.long_value))
        self.newest = self.bd = bd.long_value
        self.births, self.aliases = {}, {}

    def ndeath(self, message, payload):
        self.deaths += 1
        self.check("topics-ndeath-payload", [metric.name for metric in payload.metrics] == ["bdSeq"])
        self.check("topics-ndeath-seq", not payload.HasField("seq"))
        self.check("message-flow-edge-node-birth-publish-will-message-qos", message.qos == 1, message.qos)
        if self.bd is not None:
            bd = payload.metrics[0].long_value
            self.check("topics-nbirth-bdseq-matching", bd == self.bd, (bd, self.bd))
        self.births, self.bd, self.seq = {}, None, None

    def ddata(self, message, payload, plain, levels):
        check, cell = self.check, levels[4]
        check("topics-ddata-topic", levels[3] == self.node and len(levels) == 5, message.topic)
        check("topics-ddata-mqtt", message.qos == self.qos and plain, message.qos)
        check("topics-ddata-timestamp", payload.HasField("timestamp"))
        birth = self.births.get(cell)
        check("topics-dbirth-metric-reqs", birth is not None, message.topic)
        times = [metric.timestamp for metric in payload.metrics if not metric.is_historical]
        check("operational-behavior-data-publish-dbirth-order", times == sorted(times), times)
        for metric in payload.metrics:
            if birth is not None:
                check("payloads-name-birth-data-requirement", birth.get(metric.name) == metric.datatype, metric.name)
        named = {metric.name: metric for metric in payload.metrics}
        number, key = named["Record/Number"].long_value, (cell, self.store.get(cell))
        last = self.last.get(key, 0)
        if number <= last:
            self.repeated += 1
            return
        now = time.time()
        if number != last + 1:
            self.gaps.append((key, last + 1, number - 1, self.arrived.get(key, 0), now))
        self.last[key], self.arrived[key] = number, now
        self.accepted[cell] += 1
        if named["Record/Number"].is_historical:
            self.historical += 1
        else:
            self.delays.append(now * 1000 - named["Record/Number"].timestamp)
        if "Command/Id" in named:
            self.outcomes[named["Command/Id"].string_value].append(named["Command/Outcome"].string_value)
            self.values[named["Command/Id"].string_value] = named["Command/Detail"].string_value
        if "Event" in named:
            self.events.append((cell, named["Event"].string_value))

    def ask_rebirth(self):
        with self.lock:
            self.rebirth = self.bd
        payload = pb.Payload(timestamp=int(time.time() * 1000))
        payload.metrics.add(name="Node Control/Rebirth", timestamp=payload.timestamp, datatype=11, boolean_value=True)
        self.client.publish(f"spBv1.0/{self.group}/NCMD/{self.node}", payload.SerializeToString(), qos=0)

    def command(self, cell, order, timestamp=None):
        payload = pb.Payload(timestamp=timestamp or int(time.time() * 1000))
        text = order if isinstance(order, str) else json.dumps(order)
        payload.metrics.add(name="Command/Request", timestamp=payload.timestamp, datatype=12, string_value=text)
        self.send(cell, payload.SerializeToString())

    def send(self, cell, payload):
        self.client.publish(f"spBv1.0/{self.group}/DCMD/{self.node}/{cell}", payload, qos=0)

    def outcome(self, id):
        with self.lock:
            return list(self.outcomes.get(id, []))
