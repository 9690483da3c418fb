"""The look of a report: calm, readable on paper and in the dark."""

from __future__ import annotations

__all__ = ["STYLE"]

STYLE = """
:root { color-scheme: light dark; --text: #18212b; --muted: #566371; --line: #dbe1e7; --ground: #ffffff;
  --soft: #f4f6f8; --for: #0e7350; --against: #b92b2b; --unknown: #8a5a00; }
@media (prefers-color-scheme: dark) { :root { --text: #e7ecf1; --muted: #a0aebb; --line: #2d3843; --ground: #11161c;
  --soft: #181f27; --for: #6bd09a; --against: #ff9186; --unknown: #e9b64c; } }
* { box-sizing: border-box; }
body { margin: 0; font: 15px/1.5 -apple-system, "Segoe UI", Roboto, Helvetica, Arial, sans-serif; color: var(--text);
  background: var(--ground); }
main { max-width: 1060px; margin: 0 auto; padding: 32px 24px 80px; }
h1 { margin: 0; font-size: 1.7rem; line-height: 1.2; overflow-wrap: anywhere; }
h2 { margin: 40px 0 8px; font-size: 1.25rem; }
h3 { margin: 18px 0 4px; font-size: 1rem; }
p, li, figcaption { max-width: 78ch; }
.about, figcaption { color: var(--muted); }
.headline { margin: 8px 0; padding: 12px 16px; font-size: 1.15rem; font-weight: 600; background: var(--soft);
  border-left: 4px solid var(--unknown); }
.headline.checked { border-color: var(--for); }
.headline.doubtful, .headline.none { border-color: var(--against); }
h3.for, .accepted { color: var(--for); }
h3.against, .against, .rejected { color: var(--against); }
h3.unknown { color: var(--unknown); }
ul { margin: 4px 0; padding-left: 20px; }
figure { margin: 12px 0; }
svg { display: block; max-width: 100%; height: auto; background: #ffffff; border: 1px solid var(--line);
  border-radius: 6px; }
.pairs { display: grid; grid-template-columns: repeat(auto-fill, minmax(240px, 1fr)); gap: 16px; }
.pairs figure { margin: 0; }
.wide { margin: 12px 0; overflow-x: auto; }
table { border-collapse: collapse; font-size: 0.87rem; font-variant-numeric: tabular-nums; }
caption { padding: 4px 0; font-weight: 600; text-align: left; }
th, td { padding: 4px 10px 4px 0; text-align: left; vertical-align: top; border-bottom: 1px solid var(--line); }
thead th { color: var(--muted); font-weight: 500; }
tbody th { font-weight: 500; white-space: nowrap; }
td { max-width: 46ch; overflow-wrap: anywhere; }
.tight td { white-space: nowrap; }
.tight .words { display: inline-block; max-width: 46ch; white-space: normal; }
summary { cursor: pointer; }
dl { display: grid; grid-template-columns: max-content 1fr; gap: 2px 16px; }
dd { margin: 0; overflow-wrap: anywhere; }
code { font-size: 0.92em; overflow-wrap: anywhere; }
@media print { main { max-width: none; padding: 0; } section { break-inside: auto; } figure { break-inside: avoid; } }
"""
