import asyncio
from cellwire.aio import Line, Serial
from cellwire.isra_ball import Host

async def main():
    async with Line(Host(), Serial("/dev/ttyUSB0", 9600)) as line:
        async for event in line:
            if event["event"] == "new":  # the values may be used until event["live_until"]
                print(event["message"]["force"], event["live_until"] - line.now())

asyncio.run(main())
