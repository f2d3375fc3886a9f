"""A real Prometheus that scrapes a real bridge: every alert's and every panel's query has an answer, and an alert fires for a dead cell."""
import argparse
import json
import re
import subprocess
import time
import urllib.parse
import urllib.request
from pathlib import Path

from ground import Ground, free_port

parser = argparse.ArgumentParser()
parser.add_argument("cellwire")
parser.add_argument("place", type=Path)
args = parser.parse_args()
files = Path(__file__).parents[2] / "bridge/service/prometheus"
for command in (["check", "rules", "alerts.yml"], ["test", "rules", "alerts.test.yml"]):
    subprocess.run(["promtool", *command], cwd=files, check=True, stdout=subprocess.DEVNULL)

ground = Ground(args.cellwire, args.place / "prometheus")
ground.simulate(7)
ground.write_site("\n".join(cell.table() for cell in ground.cells))
ground.start_bridge()
port = free_port()
# Minutes would be long here: what is shown is that the expressions are right, and promtool has tested the times.
rules = re.sub(r"for: \d+m", "for: 2s", (files / "alerts.yml").read_text())
(ground.folder / "alerts.yml").write_text(rules)
(ground.folder / "prometheus.yml").write_text(f"""\
global: {{ scrape_interval: 1s, evaluation_interval: 1s }}
rule_files: [alerts.yml]
scrape_configs:
  - job_name: cellwire-bridge
    static_configs: [{{ targets: ["127.0.0.1:{ground.health_port}"] }}]
""")
subprocess.run(["promtool", "check", "config", "prometheus.yml"], cwd=ground.folder, check=True, stdout=subprocess.DEVNULL)
ground.spawn(["prometheus", "--config.file=prometheus.yml", f"--web.listen-address=127.0.0.1:{port}", "--storage.tsdb.path=data"],
             "prometheus.log", cwd=ground.folder, stderr=subprocess.STDOUT)


def ask(path, **parameters):
    url = f"http://127.0.0.1:{port}/api/v1/{path}?{urllib.parse.urlencode(parameters)}"
    try:
        answer = json.load(urllib.request.urlopen(url, timeout=5))
    except urllib.error.HTTPError as error:
        if error.code == 503:
            return None  # it is starting
        ground.fail(f"{parameters}: {error.read().decode()}")
    except OSError:
        return None
    return answer["data"]


def result(expression):
    return (ask("query", query=expression) or {}).get("result")


ground.wait("a scrape", lambda: result("cellwire_bridge_online == 1"))
ground.wait("every cell", lambda: result("sum(cellwire_bridge_link_connected) == 7"))
for cell in ground.cells:
    for id, order, _ in cell.orders(1):
        ground.order(cell.name, id, order)
# One that is refused with a reason of the metrics: a cell that takes no commands.
ground.wait("commands that were refused", lambda: result("cellwire_bridge_commands_refused_total > 0"))
ground.wait("commands that are done", lambda: result('cellwire_bridge_commands_total{outcome="done"} > 0'))
time.sleep(5)
ground.cells[5].stop()
firing = lambda: {alert["labels"]["alertname"] for alert in (ask("alerts") or {"alerts": []})["alerts"] if alert["state"] == "firing"}
ground.wait("the alert of a dead cell", lambda: "CellwireCellDead" in firing())
if firing() != {"CellwireCellDead"}:
    ground.fail(f"alerts of what is well: {firing()}")

panels = json.loads((files / "grafana.json").read_text())["panels"]
asked = 0
for panel in panels:
    for target in panel["targets"]:
        query = target["expr"].replace("$instance", ".*").replace("$__rate_interval", "10s")
        if "held_records" in query:
            query = query.removesuffix(" > 0")
        found = result(query)
        if not found:
            ground.fail(f"the panel {panel['title']}: {query} has no answer")
        labels = re.findall(r"{{(\w+)}}", target["legendFormat"])
        if any(label not in found[0]["metric"] for label in labels):
            ground.fail(f"the panel {panel['title']}: {found[0]['metric']} has not all of {labels}")
        asked += 1
states = [rule for group in ask("rules")["groups"] for rule in group["rules"]]
if any(rule["health"] != "ok" for rule in states):
    ground.fail([rule["lastError"] for rule in states if rule["health"] != "ok"])
ground.broker.kill()
ground.broker.wait()
ground.wait("the alert of a broker that is gone", lambda: "CellwireBridgeOffline" in firing())
ground.stop()
print(f"{len(states)} alerts and {asked} queries of {len(panels)} panels are answered by a Prometheus that scrapes a bridge; a dead cell and a "
      "broker that is gone are alerts, and nothing else")
