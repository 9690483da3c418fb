"""Public data: fetched once, checked always, refused in a sentence; a server of ours stands for the network."""

from __future__ import annotations

import gzip
import hashlib
import re
import threading
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from types import SimpleNamespace

import pytest

from app.cli import main
from segmap import datasets
from segmap.datasets import DATASETS, Dataset, RemoteFile, cached, dataset, fetch
from segmap.errors import DatasetError

CONTENT = b"FLASER 3 1.0 2.0 3.0\n"
FILE = RemoteFile("a/b", "0" * 40, "data/run.log", hashlib.sha256(CONTENT).hexdigest())
RUN = Dataset("run", "A run", 1, 3, (FILE,))


@pytest.fixture
def server(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[SimpleNamespace]:
    """Answers every request with ``content``, or with ``status``; remembers the paths; the cache is the test's own."""
    held = SimpleNamespace(content=CONTENT, status=200, asked=[], cache=tmp_path / "cache")

    class Handler(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            held.asked.append(self.path)
            self.send_response(held.status)
            self.send_header("Content-Length", str(len(held.content)))
            self.end_headers()
            self.wfile.write(held.content)

        def log_message(self, format: str, *arguments: object) -> None:
            pass

    web = ThreadingHTTPServer(("127.0.0.1", 0), Handler)
    threading.Thread(target=web.serve_forever, args=(0.01,), daemon=True).start()
    monkeypatch.setattr(datasets, "HOST", f"http://127.0.0.1:{web.server_port}")
    monkeypatch.setenv("SEGMAP_CACHE", str(held.cache))
    monkeypatch.setenv("no_proxy", "*")
    held.stop = lambda: (web.shutdown(), web.server_close())
    yield held
    held.stop()


def test_fetched_once(server):
    """A file is fetched from its commit, kept, and found the next time without asking anybody."""
    told: list[str] = []
    (path,) = fetch(RUN, lambda file: told.append(file.name))
    assert path.read_bytes() == CONTENT
    assert server.cache in path.parents
    server.stop()
    assert fetch(RUN, lambda file: told.append(file.name)) == (path,)
    assert server.asked == [f"/a/b/{'0' * 40}/data/run.log"]
    assert told == ["run.log"]


def test_a_damaged_file_is_fetched_again(server):
    """What lies in the cache is checked every time."""
    (path,) = fetch(RUN)
    path.write_bytes(b"damaged")
    assert fetch(RUN)[0].read_bytes() == CONTENT
    assert len(server.asked) == 2


def test_another_file_is_not_kept(server):
    """A file of another content is refused, and nothing is left of it."""
    server.content = b"something else"
    with pytest.raises(DatasetError, match=r"run\.log, as it comes from http://.* checksum differs"):
        fetch(RUN)
    assert not cached(FILE)


def test_no_network(server, monkeypatch):
    """Without a network the message says what was wanted, and where to put it by hand; that works."""
    server.stop()
    with pytest.raises(DatasetError, match=r"cannot be reached\. Check the network, or put the file") as failed:
        fetch(RUN)
    place = Path(re.search(r"yourself: (.*)$", str(failed.value))[1])
    place.parent.mkdir(parents=True, exist_ok=True)
    place.write_bytes(CONTENT)
    assert fetch(RUN) == (place,)


def test_not_found(server):
    """A server that does not have the file is quoted."""
    server.status = 404
    with pytest.raises(DatasetError, match="the server answered 404"):
        fetch(RUN)


def test_nowhere_to_keep_it(server):
    """A cache that cannot be written is one sentence."""
    server.cache.write_text("a file")
    with pytest.raises(DatasetError, match="Set SEGMAP_CACHE to a folder"):
        fetch(RUN)


def test_unknown():
    """A dataset nobody knows is refused with those that are known."""
    with pytest.raises(DatasetError, match=r"There is no dataset 'mars'\. Datasets are: intel, "):
        dataset("mars")


def test_every_dataset_names_files_at_a_commit():
    """Checksums and commits are whole; names are keys; no two files fall together in the cache."""
    files = [file for held in DATASETS.values() for file in held.files]
    for file in files:
        assert re.fullmatch(r"[0-9a-f]{64}", file.sha256)
        assert re.fullmatch(r"[0-9a-f]{40}", file.commit)
        assert file.url == f"https://raw.githubusercontent.com/{file.repository}/{file.commit}/{file.path}"
    assert len({(file.sha256[:12], file.name) for file in files}) == len(files)
    assert all(name == held.name for name, held in DATASETS.items())


def test_checksums_are_those_of_the_files_here(datasets):
    """The originals beside the repository, unpacked where they were packed for it, have these checksums."""
    digests = {
        hashlib.sha256(content).hexdigest()
        for path in datasets.glob("*/*.gz")
        for content in (path.read_bytes(), gzip.decompress(path.read_bytes()))
    }
    assert {file.sha256 for held in DATASETS.values() for file in held.files} <= digests


def test_commands(server, monkeypatch, capsys):
    """The list tells what is here; getting prints where the files are, and says what it does on the other channel."""
    monkeypatch.setattr(datasets, "DATASETS", {"run": RUN})

    def run(*arguments: str) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as stopped:
            main(arguments)
        out, err = capsys.readouterr()
        return int(stopped.value.code or 0), out, err

    assert " no " in run("datasets", "list")[1]
    status, out, err = run("datasets", "get", "run")
    assert (status, Path(out.strip()).read_bytes()) == (0, CONTENT)
    assert "fetching http://" in err
    assert " yes " in run("datasets", "list")[1]
    assert '"here": true' in run("datasets", "list", "--json")[1]
    status, out, err = run("datasets", "get", "mars")
    assert (status, out) == (2, "")
    assert "There is no dataset 'mars'" in err
