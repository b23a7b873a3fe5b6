"""A slave of the package `pymodbus`, for takt's master of a Modbus line.

    python tests/peers/modbus_slave.py LINE

LINE is one end of a serial line. Slave 7 has the registers 0 to 199, each with its own address as its value. Says "ready" when it listens.
"""

import asyncio
import sys

from pymodbus.server import ModbusSerialServer
from pymodbus.simulator import DataType, SimData, SimDevice

SLAVE = 7


async def main(line):
    values = SimData(0, values=list(range(200)), datatype=DataType.REGISTERS)
    device = SimDevice(id=SLAVE, simdata=[values])
    server = ModbusSerialServer(device, port=line, baudrate=115200)
    await server.serve_forever(background=True)
    print("ready", flush=True)
    await asyncio.Event().wait()


if __name__ == "__main__":
    asyncio.run(main(sys.argv[1]))
