"""The page of a bridge in Chromium: 50 cells, a hostile name, a cell that dies, a broker that goes, a bridge that ends."""
import argparse
import json
import signal
import subprocess
import time
from pathlib import Path

from ground import Ground

parser = argparse.ArgumentParser()
parser.add_argument("cellwire")
parser.add_argument("place", type=Path)
parser.add_argument("--cells", type=int, default=50)
args = parser.parse_args()
HOSTILE = "<img src=x onerror=alert(1)>"
PLACES = {
    "kawasaki-msg": "painter", "val2-alter": "arm", "val2-viewer": "screen", "isra-ball": "ball", "fanuc-hmi-modbus": "handling",
    "laser-eb90": "cutter", "mmacell-proto": "assembly",
}
folder = args.place / "page"
ground = Ground(args.cellwire, folder)
ground.simulate(args.cells)
cells = ground.cells
for cell in cells:
    cell.name = cell.name.replace(cell.NAME, PLACES[cell.NAME])
write = lambda: ground.write_site("\n".join(cell.table().replace(f"[cell.{HOSTILE}]", f"[cell.'{HOSTILE}']") for cell in cells))
write()
ground.start_bridge()
time.sleep(2)
script = Path(__file__).parents[1] / "page/page.mjs"
look = subprocess.Popen(["node", script, args.place / "node", f"http://127.0.0.1:{ground.health_port}", folder],
                        stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
ground.processes.append(look)


def step(step, **rest):
    look.stdin.write(json.dumps({"step": step, **rest}) + "\n")
    look.stdin.flush()
    answer = json.loads(look.stdout.readline() or '{"failed": "the browser has ended"}')
    if "ok" not in answer:
        ground.fail(answer)
    print("ok", step, *rest.values())


step("shows", selector="#name", pattern="^site-3 / bridge-1$")
step("shows", selector="#cells-alive", pattern=f"^{args.cells} of {args.cells} alive$")
step("shows", selector="#broker-state", pattern="^online$")
step("shows", selector="#rate", pattern="[1-9]")
kawasaki = cells[0]
for cell in cells[:7]:
    for id, what, _ in cell.orders(1):
        ground.order(cell.name, id, what)
ground.order(kawasaki.name, *kawasaki.slow_order())
step("shows", selector="#orders tr", pattern=f"under way{kawasaki.name}{kawasaki.name}/slow")
step("shows", selector="#orders tr.good", pattern="done")
step("shows", selector="#orders tr.bad", pattern="refused")
step("picture", name="commands", at="#commands-title")
dying = cells[5]
dying.stop()
step("shows", selector="#rows tr.bad:first-child", pattern=f"^{dying.name}dead .*cannot connect|^{dying.name}dead .*closed")
step("shows", selector="#cells-alive", pattern=f"^{args.cells - 1} of {args.cells} alive$")
step("picture", name="site")
cells[-1].name = HOSTILE
write()
ground.bridge.send_signal(signal.SIGHUP)
step("harmless", text=HOSTILE)
step("shows", selector="#cells-alive", pattern=f"^{args.cells - 1} of {args.cells} alive$")
step("wrong")
ground.broker.kill()
ground.broker.wait()
step("shows", selector="#broker-state", pattern="^offline$")
step("shows", selector="#broker-why", pattern="refused|closed|reset|peer")
step("shows", selector="#store-records", pattern="[1-9][0-9]{2,} wait")
step("picture", name="no-broker")
ground.start_broker()
step("shows", selector="#broker-state", pattern="^online$")
step("shows", selector="#store-records", pattern="^[0-9]{1,2} wait")
step("wrong")
ground.bridge.kill()
ground.bridge.wait()
step("shows", selector="#news", pattern="no data from the bridge for")
step("picture", name="no-bridge")
ground.start_bridge()
step("shows", selector="#news", pattern="^live$")
step("shows", selector="#cells-alive", pattern=f"^{args.cells - 1} of {args.cells} alive$")
step("wrong", but="ERR_CONNECTION_REFUSED|ERR_INCOMPLETE_CHUNKED_ENCODING")
ground.stop()
print(f"done; the pictures are in {folder}")
