"""What a hostile page beside ours, and hostile words within it, can do in a real browser: nothing."""

from __future__ import annotations

import http.server
import threading
from collections.abc import Iterator
from contextlib import closing, contextmanager
from typing import Any

import httpx

from app.resources import samples_folder
from app.security import UPLOAD_BYTES

PICTURE = "<img src=x onerror='window.hit=1'>"
SCRIPT = f"{PICTURE}<script>window.hit=1</script>"
ATTACK = """async (target) => {
  const tried = {};
  const noted = async (name, work) => { try { tried[name] = await work(); } catch { tried[name] = "refused"; } };
  const arrives = (object, good) => new Promise((resolve) => {
    object[good] = () => resolve("arrived");
    object.onerror = object.onclose = () => resolve("refused");
  });
  const decide = JSON.stringify({ integrations: ["0.0-0.1"], verdict: "rejected" });
  const picture = new Image();
  const script = document.createElement("script");
  await noted("read", async () => (await fetch(`${target.url}/api/projects`, { credentials: "include" })).text());
  const post = async (more) => (await fetch(`${target.api}/decisions`, { method: "POST", body: decide, ...more })).type;
  await noted("decide", () => post({ mode: "no-cors" }));
  await noted("decide as JSON", () => post({ headers: { "Content-Type": "application/json" } }));
  await noted("events", () => arrives(new EventSource(`${target.api}/events`), "onopen"));
  await noted("socket", () => arrives(new WebSocket(target.socket), "onopen"));
  await noted("picture", () => {
    picture.src = `${target.url}/static/favicon.svg`;
    return arrives(picture, "onload");
  });
  await noted("script", () => {
    script.src = `${target.url}/static/js/dom.js`;
    document.head.append(script);
    return arrives(script, "onload");
  });
  return tried;
}"""


@contextmanager
def foreign_page() -> Iterator[str]:
    """An empty page of another origin; yields its address."""

    class Page(http.server.BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            self.send_response(200)
            self.send_header("Content-Type", "text/html")
            self.end_headers()
            self.wfile.write(b"<!doctype html><title>Win a prize</title>")

        def log_message(self, *_: object) -> None:
            pass

    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), Page) as serving:
        thread = threading.Thread(target=serving.serve_forever, daemon=True)
        thread.start()
        yield f"http://localhost:{serving.server_port}"
        serving.shutdown()


def test_a_foreign_page_reads_and_changes_nothing(make_desk: Any, server: Any) -> None:
    """Neither by fetch nor by form, stream, socket, picture, script or frame; and what was decided is as it was."""
    project = server.open_sample("hall")
    before = server.get(f"/api{project}")["revision"]
    view = httpx.post(f"{server.url}/api{project}/views", timeout=60.0).json()
    socket = server.url.replace("http", "ws") + view["scene"].rstrip("/")
    target = {"url": server.url, "api": f"{server.url}/api{project}", "socket": socket}
    with foreign_page() as url, closing(make_desk().page.context) as window:
        (page,) = window.pages
        page.goto(url)
        tried = page.evaluate(ATTACK, target)
        framed = page.evaluate(
            """(url) => new Promise((done) => {
              const frame = document.createElement("iframe");
              frame.onload = () => { try { done(String(frame.contentDocument?.title)); } catch { done("refused"); } };
              frame.src = url;
              document.body.append(frame);
            })""",
            f"{server.url}{project}",
        )
    assert tried.pop("decide") in ("opaque", "refused")  # sent, without being told what came of it
    assert set(tried.values()) == {"refused"}, tried
    assert framed in ("refused", "null", "undefined", "")
    assert server.get(f"/api{project}")["revision"] == before


def test_hostile_words_are_words(desk: Any, server: Any) -> None:
    """Scripts in the names of project, log and person and in a reason are read as text on every part of the page."""
    log = (samples_folder() / "hall.log").read_bytes()
    made = httpx.post(f"{server.url}/api/projects", files={"files": (f"{PICTURE}.log", log)}, timeout=60.0).json()
    server.wait_until_matched(made["url"])
    said = {"integrations": ["0.0-0.1"], "verdict": "rejected", "reason": SCRIPT, "who": SCRIPT}
    assert httpx.post(f"{server.url}/api{made['url']}/decisions", json=said, timeout=60.0).status_code == 200
    desk.open(server.url + made["url"])
    desk.page.locator("[data-filter=rejected]").click()
    desk.row("0.0-0.1").click()
    desk.until(lambda: SCRIPT in desk.page.inner_text("body"), "the reason, as text")
    assert desk.page.locator("#name").inner_text() == PICTURE
    desk.picture("hostile")
    for tab in desk.page.locator("[role=tab]").all():
        if tab.is_visible():
            tab.click()
    for part in (desk.page, desk.scene):
        assert part.evaluate("window.hit") is None
        assert part.locator("img[src=x]").count() == 0
    desk.page.goto(server.url)
    desk.page.locator("#projects").get_by_text(PICTURE).first.wait_for()
    assert desk.page.evaluate("window.hit") is None


def test_files_above_the_bound_are_not_sent(desk: Any, server: Any) -> None:
    """The page says so at once, with the way that takes any size."""
    desk.page.goto(server.url)
    desk.page.locator("#drop button").wait_for()
    transfer = desk.page.evaluate_handle(
        "size => { const data = new DataTransfer(); data.items.add(new File([new ArrayBuffer(size)], 'big.log'));"
        " return data; }",
        UPLOAD_BYTES + 1,
    )
    desk.page.dispatch_event("main", "drop", {"dataTransfer": transfer})
    assert "segmap serve" in desk.page.locator("#drop .message.error").inner_text()
