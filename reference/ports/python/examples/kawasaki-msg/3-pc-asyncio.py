import asyncio
from cellwire.aio import Line, Listen
from cellwire.kawasaki_msg import Pc

async def main():
    pc = Pc()
    async with Line(pc, Listen("127.0.0.1", 9105)) as line:
        line.do(pc.start, 50, [{"kind": 1, "x1": 0, "y1": 0, "x2": 100, "y2": 0}])
        async for event in line:
            print(event)
            if event["event"] in ("order_over", "outcome_unknown"):
                break

asyncio.run(main())
