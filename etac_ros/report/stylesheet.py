"""The style sheet of the page: a report on screen, light and dark, on a phone, and on paper."""

from __future__ import annotations

STYLESHEET = """
:root {
  color-scheme: light dark;
  --paper: #ffffff; --ink: #1c2430; --muted: #55606e; --line: #d9dee5; --band: #f5f7f9; --accent: #0b4fae;
  --warn-ink: #6b4200; --warn-paper: #fff6e0; --warn-line: #e8c36a;
}
@media screen and (prefers-color-scheme: dark) {
  :root {
    --paper: #161b22; --ink: #e6eaf0; --muted: #a3adba; --line: #323b47; --band: #1d242d; --accent: #6fb1ff;
    --warn-ink: #ffdd9b; --warn-paper: #33290f; --warn-line: #7a5f1d;
  }
}
* { box-sizing: border-box; }
body {
  margin: 0; background: var(--paper); color: var(--ink);
  font: 16px/1.5 system-ui, -apple-system, "Segoe UI", "Liberation Sans", Arial, sans-serif;
}
main { max-width: 76rem; margin: 0 auto; padding: 2rem 1.25rem 3rem; }
header { border-bottom: 2px solid var(--ink); margin-bottom: 1.25rem; padding-bottom: 0.75rem; }
.kicker { margin: 0; color: var(--muted); font-size: 0.875rem; }
h1 { margin: 0.15rem 0 0; font-size: 1.6rem; line-height: 1.25; font-weight: 650; }
h2 { margin: 2.25rem 0 0.5rem; font-size: 1.15rem; font-weight: 650; }
.lead { margin: 0.6rem 0 0; font-size: 1.05rem; }
.tiles {
  display: grid; grid-template-columns: repeat(auto-fit, minmax(9.5rem, 1fr)); gap: 0.75rem;
  margin: 1.25rem 0;
}
.tile { border: 1px solid var(--line); border-radius: 6px; padding: 0.6rem 0.8rem; background: var(--band); }
.tile b {
  display: block; font-size: 1.45rem; line-height: 1.2; color: var(--accent);
  font-variant-numeric: tabular-nums;
}
.tile span { color: var(--muted); font-size: 0.875rem; }
.remark {
  margin: 0.75rem 0; padding: 0.5rem 0.8rem; border: 1px solid var(--warn-line); border-radius: 6px;
  background: var(--warn-paper); color: var(--warn-ink);
}
.scroll { overflow-x: auto; }
.scroll:focus-visible { outline: 2px solid var(--accent); outline-offset: 2px; }
table { border-collapse: collapse; font-size: 0.9rem; font-variant-numeric: tabular-nums; }
th, td {
  padding: 0.28rem 1.1rem 0.28rem 0; text-align: right; white-space: nowrap; vertical-align: baseline;
}
thead th {
  vertical-align: bottom; font-weight: 600; color: var(--muted); border-bottom: 1px solid var(--ink);
  white-space: normal;
}
tr.groups th { border-bottom: 0; padding-bottom: 0; color: var(--ink); }
tbody th { font-weight: 400; }
tbody tr { border-bottom: 1px solid var(--line); }
tr.strong { border-bottom: 1px solid var(--muted); }
tr.strong th, tr.strong td { font-weight: 650; }
.text { text-align: left; }
th.wide, td.wide { white-space: normal; overflow-wrap: anywhere; min-width: 8rem; }
td:last-child, th:last-child { padding-right: 0.2rem; }
.note { margin: 0.4rem 0 0; color: var(--muted); font-size: 0.875rem; max-width: 48rem; }
figure { margin: 1.75rem 0 2.25rem; }
figure .scroll { border: 1px solid var(--line); border-radius: 6px; padding: 0.5rem; }
figure img { display: block; width: 100%; min-width: 600px; height: auto; }
figure .plot {
  border: 1px solid var(--line); border-radius: 6px; padding: 0.25rem; min-height: 200px; overflow: hidden;
}
.slider { display: flex; gap: 0.75rem; align-items: center; margin: 0.5rem 0 0; }
.slider input { flex: 1; accent-color: var(--accent); }
.slider output { min-width: 8.5rem; font-variant-numeric: tabular-nums; }
figcaption { margin-top: 0.5rem; font-size: 0.9375rem; max-width: 48rem; }
figcaption b { font-weight: 650; }
footer {
  margin-top: 2.5rem; border-top: 1px solid var(--line); padding-top: 0.75rem;
  color: var(--muted); font-size: 0.875rem;
}
@media (max-width: 40rem) {
  main { padding: 1.25rem 0.9rem 2rem; }
  h1 { font-size: 1.35rem; }
  tbody th { white-space: normal; min-width: 6.5rem; }
}
@media print {
  @page { margin: 16mm 14mm; }
  body { font-size: 10pt; }
  main { max-width: none; padding: 0; }
  h2 { break-after: avoid; }
  section, figure, .tiles, .remark { break-inside: avoid; }
  .scroll { overflow: visible; }
  figure { margin: 1rem 0; }
  figure .scroll, figure .plot { border: 0; padding: 0; }
  .slider { display: none; }
  figure img { min-width: 0; }
  .tile { background: none; }
}
""".strip()
