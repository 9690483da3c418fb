"""The layers point one way, and the library leaves the world alone."""

from __future__ import annotations

import ast
import importlib
import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).resolve().parents[1]
LIBRARY = ROOT / "segmap"

ORDER = (
    "errors",
    "parameters",
    "pose",
    "priors",
    "_threads",
    "tracing",
    "_kernels",
    "_value_kernels",
    "_stepping",
    "_sight_kernels",
    "_hold_kernels",
    "_field_kernels",
    "_refine_kernels",
    "_bound_kernels",
    "_search_kernels",
    "scans",
    "segments",
    "logs",
    "candidates",
    "bounds",
    "evaluation",
    "visibility",
    "fields",
    "refinement",
    "verification",
    "verdict",
    "chains",
    "matches",
    "placing",
    "explanation",
    "fusion",
    "paper_mode",
    "verified_mode",
    "integration",
    "merging",
    "graph",
    "spreading",
    "links",
    "consensus",
    "keyframes",
    "loops",
    "strays",
    "second_looks",
    "holding",
    "mapping",
    "revisits",
    "events",
    "project",
    "_database",
    "store",
    "simulate",
    "export",
    "relations",
    "benchmark",
    "pair_pictures",
    "walkthrough",
    "datasets",
)
"""The data flow: a module imports only from those before it, or from its own package."""
WEB = {"app", "fastapi", "starlette", "uvicorn", "viser", "httpx", "websockets", "typer", "rich"}
TOUCH_FILES = {"logs", "export", "_database", "store", "benchmark", "simulate", "datasets"}
FILE_MODULES = {"os", "shutil", "tempfile", "sqlite3", "gzip", "zipfile", "glob", "platformdirs"}
FILE_CALLS = {"open", "read_text", "write_text", "read_bytes", "write_bytes", "mkdir", "unlink", "loadtxt", "savetxt"}
SCENE = {"scene", "proxy"}
"""the only modules of app that know viser"""


def _files(folder: Path) -> list[Path]:
    return sorted(folder.rglob("*.py"))


def _name(path: Path) -> str:
    parts = path.relative_to(ROOT).with_suffix("").parts
    return ".".join(parts[:-1] if parts[-1] == "__init__" else parts)


def _layer(module: str) -> str:
    """``logs`` of ``segmap.logs.carmen``; empty for ``segmap`` itself."""
    return module.split(".")[1] if "." in module else ""


def _imports(path: Path) -> Iterator[str]:
    """Every module imported anywhere in a file, with the names taken from it."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Import):
            yield from (alias.name for alias in node.names)
        elif isinstance(node, ast.ImportFrom):
            assert not node.level, f"{path}:{node.lineno}: imports are absolute here"
            yield from (f"{node.module}.{alias.name}" for alias in node.names)


def _calls(path: Path) -> Iterator[str]:
    """The last part of the name of everything called in a file."""
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Call):
            yield ast.unparse(node.func).rpartition(".")[2]


def _ids(path: Path) -> str:
    return _name(path)


every_library_module = pytest.mark.parametrize("path", _files(LIBRARY), ids=_ids)
every_app_module = pytest.mark.parametrize("path", _files(ROOT / "app"), ids=_ids)


@every_library_module
def test_a_module_imports_only_from_modules_before_it(path: Path) -> None:
    """In segmap the order of imports is the flow of data."""
    layer = _layer(_name(path))
    assert layer in ("", *ORDER), f"segmap/{layer} has no place in the data flow yet: give it one in ORDER"
    allowed = ORDER if not layer else ORDER[: ORDER.index(layer) + 1]
    found = {_layer(name) for name in _imports(path) if name.startswith("segmap.")}
    assert found <= set(allowed)


@every_library_module
def test_the_library_knows_no_web(path: Path) -> None:
    """Segmap never imports app, nor anything that serves or draws pages, nor the command line's tools."""
    assert not {name.split(".")[0] for name in _imports(path)} & WEB


@every_library_module
def test_only_some_layers_touch_files(path: Path) -> None:
    """Only readers, writers, the store, the benchmark and the simulator open files."""
    if _layer(_name(path)) in TOUCH_FILES:
        return
    assert not {name.split(".")[0] for name in _imports(path)} & FILE_MODULES
    assert not set(_calls(path)) & FILE_CALLS


@every_library_module
def test_the_library_prints_nothing_and_keeps_no_global_state(path: Path) -> None:
    """No print, no ``global``."""
    assert "print" not in set(_calls(path))
    assert not any(isinstance(node, ast.Global) for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))))


@every_library_module
def test_every_module_says_what_is_public(path: Path) -> None:
    """``__all__`` is there and names things that exist."""
    module = importlib.import_module(_name(path))
    if path == LIBRARY / "__init__.py" and not hasattr(module, "__all__"):
        return
    assert [name for name in module.__all__ if not hasattr(module, name)] == []


@every_app_module
def test_only_the_scene_and_its_proxy_know_viser(path: Path) -> None:
    """Everything else of the workbench works on plain data."""
    if path.relative_to(ROOT / "app").parts[0].removesuffix(".py") not in SCENE:
        assert "viser" not in {name.split(".")[0] for name in _imports(path)}


def test_pages_take_nothing_from_elsewhere() -> None:
    """No CDN, no font, no script of another address: the workbench works without a network."""
    foreign = re.compile(r"""(?:src|<link[^>]*href|import|from|url|fetch)\s*[=(]?\s*["'(]\s*(?:https?:)?//""")
    for path in sorted((ROOT / "static").rglob("*")):
        if path.suffix in {".html", ".js", ".css"}:
            assert not foreign.search(path.read_text(encoding="utf-8")), path
