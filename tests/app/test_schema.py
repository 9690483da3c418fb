"""Whatever a request that fits the API's own description holds, or almost fits, the answer is never an error of ours.

SEGMAP_EXAMPLES=1000 pytest tests/app/test_schema.py tries longer.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from typing import Any

import pytest
from hypothesis import HealthCheck, Phase, given, seed, settings
from hypothesis import strategies as st

from app.server import create_app

schemathesis = pytest.importorskip("schemathesis", reason="schemathesis is not installed: pip install schemathesis")
requests = pytest.importorskip("requests")

EXAMPLES = int(os.environ.get("SEGMAP_EXAMPLES", "8"))
ENDLESS = "/api/projects/{project}/events"
"""never ends, so a client in this process would never see its answer"""
SPARED = {("DELETE", "/api/projects/{project}"), ("POST", "/api/projects/{project}/loops")}
"""not tried on the project that the others need: one removes it, the other starts processes"""
OPERATIONS = [
    (path, method.upper())
    for path, methods in create_app().openapi()["paths"].items()
    for method in methods
    if path != ENDLESS
]


@pytest.fixture(scope="module")
def site(
    running_client: Any, tmp_path_factory: pytest.TempPathFactory, log_bytes: bytes
) -> Iterator[tuple[Any, dict[str, str], Any]]:
    """A client of an app with a project, what there is in it to put into addresses, and the app's description."""
    with running_client(tmp_path_factory.mktemp("projects")) as client:
        id = client.upload(("robot.log", log_bytes)).json()["id"]
        client.settle(id).decide(["0.0-0.1", "0.1-0.2"], "accepted")
        view = client.post(f"/api/projects/{id}/views").json()["id"]
        real = {"project": id, "integration": "0.0-0.1", "view": view, "format": "svg", "sample": "hall"}
        yield client, real, schemathesis.openapi.from_dict(client.get("/api/openapi.json").json())


@pytest.mark.parametrize(("path", "method"), OPERATIONS, ids=lambda part: part)
@pytest.mark.slow
def test_no_request_breaks_the_server(site: tuple[Any, dict[str, str], Any], path: str, method: str) -> None:
    """Answers are 2xx or 4xx, and a refusal is a sentence."""
    client, real, description = site
    operation = description[path][method]
    modes = (schemathesis.GenerationMode.POSITIVE, schemathesis.GenerationMode.NEGATIVE)
    cases = st.one_of(*(operation.as_strategy(generation_mode=mode) for mode in modes))

    @seed(1)
    @settings(
        max_examples=EXAMPLES,
        database=None,
        phases=[Phase.generate],
        suppress_health_check=list(HealthCheck),
    )
    @given(cases, st.booleans())
    def tried(case: Any, deep: bool) -> None:
        if deep and (method, path) not in SPARED:
            case.path_parameters = {name: real.get(name, value) for name, value in case.path_parameters.items()}
        check(client, case)

    tried()


def check(client: Any, case: Any) -> None:
    """Send a request as a browser would, and look at the answer."""
    try:
        request = requests.Request(**case.as_transport_kwargs(base_url="http://127.0.0.1:8000")).prepare()
    except (ValueError, UnicodeError, requests.RequestException):
        return  # no program could send it
    headers = {k: v for k, v in request.headers.items() if k.lower() not in ("content-length", "host")}
    body = request.body.encode("utf-8", "replace") if isinstance(request.body, str) else request.body
    answer = client.request(request.method, request.url, headers=headers, content=body or b"")
    assert answer.status_code < 500, (request.method, request.url, body, answer.text)
    if answer.status_code >= 400 and request.method != "HEAD":
        assert answer.json()["error"]["message"]
