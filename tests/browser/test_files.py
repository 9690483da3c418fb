"""The files of the pages hold together, and hold nothing that they must not."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

STATIC = Path(__file__).resolve().parents[2] / "static"
PAGES = sorted(STATIC.glob("*.html"))
SCRIPTS = sorted(STATIC.glob("js/*.js"))
SHEETS = sorted(STATIC.glob("css/*.css"))
TEXTS = {path: path.read_text(encoding="utf-8") for path in (*PAGES, *SCRIPTS, *SHEETS)}
EXPORT = re.compile(r"^export (?:async )?(?:const|function|class) (\w+)", re.MULTILINE)
ICON = re.compile(r'icons\.svg#(\w+)|icon\("(\w+)"\)|icon: "(\w+)"')
IDS = {name for page in PAGES for name in re.findall(r'\bid="([^"]+)"', TEXTS[page])}


def named(paths: list[Path]) -> pytest.MarkDecorator:
    return pytest.mark.parametrize("path", paths, ids=lambda path: path.name)


@named(PAGES)
def test_pages_have_no_inline_script_or_style(path: Path) -> None:
    """The content security policy would refuse them."""
    inline = r"<script(?![^>]*\bsrc=)|<style|\sstyle=|\son[a-z]+="
    assert not re.findall(inline, TEXTS[path])


@named(SCRIPTS)
def test_scripts_never_parse_html(path: Path) -> None:
    """Names of files and of people become text, never elements."""
    forbidden = r"innerHTML|outerHTML|insertAdjacentHTML|document\.write|DOMParser|srcdoc|\beval\(|new Function"
    assert not re.findall(forbidden, TEXTS[path])


@named([*PAGES, *SCRIPTS, *SHEETS])
def test_nothing_comes_from_elsewhere(path: Path) -> None:
    """The pages work without a network."""
    addresses = set(re.findall(r"(?:https?:)?//[a-z0-9.]+\.[a-z]+[^\s\"']*", TEXTS[path]))
    assert addresses <= {"http://www.w3.org/2000/svg"}


@named([*PAGES, *SCRIPTS, *SHEETS])
def test_every_file_that_is_named_exists(path: Path) -> None:
    """Scripts, sheets and pictures are there."""
    for name in re.findall(r"/static/([\w./-]+)", TEXTS[path]):
        assert (STATIC / name).is_file(), name
    for name in re.findall(r'from "\./([\w.]+)"', TEXTS[path]):
        assert (path.parent / name).is_file(), name


@named(SCRIPTS)
def test_every_import_is_exported(path: Path) -> None:
    """A name that is not exported would stop the whole page."""
    for names, module in re.findall(r'import \{([^}]+)\} from "\./([\w.]+)"', TEXTS[path]):
        exported = EXPORT.findall(TEXTS[path.parent / module])
        assert {name.strip() for name in names.split(",")} <= set(exported), module


@named(SCRIPTS)
def test_every_import_is_used(path: Path) -> None:
    """What is imported is needed."""
    for names, _ in re.findall(r'import \{([^}]+)\} from "\./([\w.]+)"', TEXTS[path]):
        unused = [name for name in map(str.strip, names.split(",")) if len(re.findall(rf"\b{name}\b", TEXTS[path])) < 2]
        assert not unused


@named(SCRIPTS)
def test_every_element_a_script_asks_for_is_on_a_page(path: Path) -> None:
    """Ids in scripts and pages agree."""
    assert set(re.findall(r'byId\("([^"]+)"\)', TEXTS[path])) <= IDS


def test_every_icon_is_drawn() -> None:
    """Icons that are named are in the sprite."""
    drawn = set(re.findall(r'<symbol id="(\w+)"', (STATIC / "icons.svg").read_text(encoding="utf-8")))
    used = {name for text in TEXTS.values() for name in ICON.findall(text)}
    assert {name for found in used for name in found if name} <= drawn


def test_hotkeys_leave_the_camera_alone() -> None:
    """W A S D Q E and the arrows move the scene's camera; no key does two things."""
    keys = re.findall(r'^ {4}\["([^"]+)",', TEXTS[STATIC / "js" / "keys.js"], re.MULTILINE)
    assert len(keys) > 10
    assert len(set(keys)) == len(keys)
    assert not [key for key in keys if key.split("+")[-1] in {*"WASDQE"} or key.startswith("Arrow")]


@named([*PAGES, *SCRIPTS, *SHEETS])
def test_files_stay_small(path: Path) -> None:
    """A file one can read in one go, in lines one can read."""
    lines = TEXTS[path].splitlines()
    assert len(lines) < 400
    assert path.suffix == ".html" or max(map(len, lines)) <= 160
