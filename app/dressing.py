"""What is put into viser's page: how the scene is handled, and colours that can be read.

It uses viser's own test hook and Mantine's names of colours, so viser's version is pinned and tests look.
"""

from __future__ import annotations

__all__ = ["SCRIPT", "STYLE"]

SCRIPT = b"""<script>
(() => {
  // In 2D (a field of view of one degree) every drag moves the map, and no key turns the camera.
  const moves = /^(Key[WASDQE]|Arrow(Up|Down|Left|Right))$/;
  const viewer = () => window.__viserMutable ?? {};
  const flat = () => viewer().camera?.fov < 5;
  const set = (held, name, value) => { if (held && held[name] !== value) held[name] = value; };
  addEventListener("keydown", (event) => {
    if (!flat() || !moves.test(event.code) || event.target.closest?.("input, textarea")) return;
    event.stopImmediatePropagation();
  }, true);
  setInterval(() => {
    const control = viewer().cameraControl, held = flat();
    if (!control || !viewer().camera) return;
    set(control.mouseButtons, "left", held ? 2 : 1);
    set(control.touches, "one", held ? 128 : 64);
    set(control, "dollyToCursor", held);
    scaleBar(held, control.distance);
    name();
  }, 100);

  // Buttons that are only a picture get the name of what they do.
  const names = [["Notification-closeButton", "Close this message"], ["tabler-icon-list-search", "All commands"]];
  const name = () => {
    for (const button of document.querySelectorAll("button:not([aria-label])")) {
      if (button.textContent.trim()) continue;
      const known = names.find(([part]) => button.className.includes(part) || button.innerHTML.includes(part));
      button.setAttribute("aria-label", known?.[1] ?? "Connection and settings of the scene");
    }
  };

  // How long a metre is on the screen: only in 2D, where it is the same everywhere.
  const bar = Object.assign(document.createElement("div"), { id: "scale-bar", ariaHidden: "true" });
  bar.style.cssText = "position:fixed;left:14px;bottom:14px;z-index:5;padding:0 4px 2px;pointer-events:none;" +
    "font:600 12px system-ui,sans-serif;border:solid;border-width:0 2px 2px;text-align:center;" +
    "color:var(--mantine-color-text,#444);border-color:currentColor";
  const nice = (most) => {
    const power = 10 ** Math.floor(Math.log10(most));
    return [5, 2, 1].find((step) => step * power <= most) * power;
  };
  const scaleBar = (shown, distance) => {
    if (!bar.isConnected && document.body) document.body.append(bar);
    bar.hidden = !shown;
    const canvas = document.querySelector("canvas"), tall = canvas?.clientHeight;
    if (!shown || !tall || !(distance > 0)) return;
    const metre = tall / (2 * distance * Math.tan((viewer().camera.fov * Math.PI) / 360));
    const length = nice(120 / metre);
    bar.style.width = `${length * metre}px`;
    bar.textContent = length < 1 ? `${Math.round(100 * length)} cm` : `${length} m`;
  };
})();
</script>
"""
"""how the scene is handled: every drag moves a flat map, a bar says how long a metre is, every button has a name"""
STYLE = b"""<style>
:root[data-mantine-color-scheme="light"] {
  --mantine-color-dimmed: #566371 !important; --mantine-color-anchor: #00569e !important; }
:root[data-mantine-color-scheme="dark"] { --mantine-color-dimmed: #a6b2be !important; }
:root { --mantine-color-red-filled: #c92a2a !important; --mantine-color-red-filled-hover: #b02525 !important;
  --mantine-color-gray-filled: #5c6670 !important; --mantine-color-gray-filled-hover: #4d565f !important; }
[data-mantine-color-scheme="light"] .mantine-Button-root[data-variant="outline"] { --button-color: #00569e !important; }
[data-mantine-color-scheme="dark"] .mantine-Button-root[data-variant="outline"] { --button-color: #74bcf9 !important; }
</style>
"""
"""Mantine's grey and viser's blue are too faint for small letters"""
