"""A workbench that serves until it is killed; driven by crashing.py.

    python server_victim.py WORKSPACE

For each line on standard input a child serves the projects of WORKSPACE, says ``at PORT`` and matches,
merges and writes as any server does. When it is dead, ``dead`` is said. What takes time to load is
loaded once, before the children are made.
"""

from __future__ import annotations

import logging
import os
import sys
from pathlib import Path
from typing import Any

import uvicorn

from app.resources import samples_folder
from app.server import create_app
from app.workspace import Workspace
from segmap.integration import integrate
from segmap.logs import read_log
from segmap.parameters import preset
from segmap.segments import extract


def say(line: str) -> None:
    os.write(1, (line + "\n").encode())


def load() -> None:
    """Have everything imported and compiled."""
    parameters = preset("verified")
    log = read_log(samples_folder() / "hall.log")
    integrate(extract(log[0], parameters), extract(log[1], parameters), parameters, mode="verified")


class Server(uvicorn.Server):
    async def startup(self, sockets: Any = None) -> None:
        await super().startup(sockets)
        say(f"at {self.servers[0].sockets[0].getsockname()[1]}")


def main() -> None:
    load()
    logging.disable(logging.CRITICAL)
    say("ready")
    for _ in sys.stdin:
        child = os.fork()
        if child == 0:
            say(f"pid {os.getpid()}")
            app = create_app(Workspace(Path(sys.argv[1])))
            Server(uvicorn.Config(app, port=0, log_level="critical", ws="none")).run()
            os._exit(1)
        os.waitpid(child, 0)
        say("\ndead")


if __name__ == "__main__":
    main()
