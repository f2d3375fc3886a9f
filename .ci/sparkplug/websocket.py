"""MQTT over WebSocket for a broker that has none: each connection's bytes go to a TCP port. Usage: PORT CERTIFICATE KEY BROKER_PORT."""
import asyncio
import ssl
import sys

import websockets

port, certificate, key, to = sys.argv[1:]


async def serve(socket):
    reader, writer = await asyncio.open_connection("127.0.0.1", int(to))

    async def down():
        while data := await reader.read(65536):
            await socket.send(data)
        await socket.close()

    task = asyncio.create_task(down())
    try:
        async for message in socket:
            writer.write(message)
            await writer.drain()
    except (websockets.ConnectionClosed, OSError):
        pass
    task.cancel()
    writer.close()


async def main():
    context = ssl.SSLContext(ssl.PROTOCOL_TLS_SERVER)
    context.load_cert_chain(certificate, key)
    async with websockets.serve(serve, "127.0.0.1", int(port), ssl=context, subprotocols=["mqtt"], max_size=None):
        await asyncio.Future()


asyncio.run(main())
