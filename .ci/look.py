"""Look at a running workbench as a browser would: do its pages, scripts and samples come?

python look.py http://127.0.0.1:PORT
"""

from __future__ import annotations

import json
import re
import sys
import time
from urllib.error import URLError
from urllib.parse import urljoin
from urllib.request import Request, urlopen

PATIENCE = 120.0
LINKED = re.compile(r"""<(?:script|link|img)[^>]*?\s(?:src|href)\s*=\s*["']([^"'#]+)["']""")
IMPORTED = re.compile(r"""(?:\bfrom|\bimport)\s*\(?["'](\.{1,2}/[^"']+)["']""")


def fetch(url: str, body: dict[str, object] | None = None) -> str:
    """The text at an address; a body is posted as JSON."""
    data = None if body is None else json.dumps(body).encode()
    with urlopen(Request(url, data, {"Content-Type": "application/json"}), timeout=60) as answer:
        return str(answer.read().decode())


def wait_for(url: str) -> str:
    """The text at an address, as soon as somebody answers there."""
    end = time.monotonic() + PATIENCE
    while True:
        try:
            return fetch(url)
        except URLError:
            if time.monotonic() > end:
                raise
            time.sleep(0.2)


def page(url: str, text: str | None = None) -> set[str]:
    """Fetch a page, all it links to and all that imports; returns their addresses."""
    found, waiting = {url}, linked(url, fetch(url) if text is None else text, LINKED)
    if not waiting:
        raise SystemExit(f"{url} links to no script or style")
    while waiting := waiting - found:
        file = waiting.pop()
        found.add(file)
        content = fetch(file)
        if not content.strip():
            raise SystemExit(f"{file} is empty")
        waiting |= linked(file, content, IMPORTED)
    return found


def linked(url: str, text: str, pattern: re.Pattern[str]) -> set[str]:
    """The addresses of this server that a file names."""
    origin = "/".join(url.split("/", 3)[:3])
    return {link for link in (urljoin(url, name) for name in pattern.findall(text)) if link.startswith(f"{origin}/")}


def main(server: str) -> None:
    """Home page, samples with their pictures, the project opened at the start, and one made of a sample."""
    files = page(f"{server}/", wait_for(f"{server}/"))
    samples = json.loads(fetch(f"{server}/api/samples"))["samples"]
    for sample in samples:
        if "<svg" not in fetch(urljoin(server, sample["picture"])):
            raise SystemExit(f"the sample {sample['name']} has no picture")
    made = json.loads(fetch(f"{server}/api/projects", {"sample": samples[-1]["name"]}))
    projects = json.loads(fetch(f"{server}/api/projects"))["projects"]
    if len(projects) < 2:
        raise SystemExit(f"two projects were opened, {len(projects)} are listed")
    for project in projects:
        files |= page(urljoin(server, project["url"]))
    state = json.loads(fetch(f"{server}/api/projects/{made['id']}"))
    print(f"{len(files)} files, {len(samples)} samples, {len(projects)} projects; {state['name']}: {state['progress']}")


if __name__ == "__main__":
    main(sys.argv[1])
