import asyncio
from cellwire.aio import Line, Serial
from cellwire.val2_alter import Host

async def main():
    host, cycles = Host(), 0
    async with Line(host, Serial("/dev/ttyUSB0", 38400)) as line:
        async for event in line:
            print(event)
            if event["event"] == "motion" and cycles < 160:  # 10/32 mm along X in each: 50 mm, and 200 ms more
                cycles += 1
                line.do(host.set_target, [10, 0, 0, 0, 0, 0])

asyncio.run(main())
