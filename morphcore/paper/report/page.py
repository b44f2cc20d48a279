"""The page around the sections: one HTML file that needs nothing else, on paper, in light and in the dark."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape

from morphcore.paper.report.html import Section

STYLE = """
:root {
  color-scheme: light dark;
  --ink: #1c1e21; --soft: #5b6169; --page: #fdfdfc; --line: #d5d8dc; --band: #f3f4f5;
  --mark: #0b5c99; --good: #17693a; --bad: #a12a16; --picture: #ffffff;
}
@media (prefers-color-scheme: dark) {
  :root {
    --ink: #e4e6e9; --soft: #a2a9b2; --page: #16181b; --line: #3a3f45; --band: #1f2226;
    --mark: #7cb8ec; --good: #6fce93; --bad: #f08a74; --picture: #ffffff;
  }
}
* { box-sizing: border-box; }
html { -webkit-text-size-adjust: 100%; }
body {
  margin: 0 auto; padding: 2.5rem 1.25rem 5rem; max-width: 56rem; color: var(--ink);
  background: var(--page); font: 1rem/1.55 Charter, "Bitstream Charter", "Source Serif 4", Cambria, Georgia,
  "DejaVu Serif", serif;
}
h1, h2, h3, nav, table, figcaption, .note, .meta, .verdict {
  font-family: system-ui, -apple-system, "Segoe UI", "Helvetica Neue", "Noto Sans", "DejaVu Sans", sans-serif;
}
h1 { font-size: 1.75rem; line-height: 1.25; margin: 0 0 .4rem; letter-spacing: -.01em; }
h2 {
  font-size: 1.25rem; line-height: 1.3; margin: 3.2rem 0 .8rem; padding-top: .9rem;
  border-top: 1px solid var(--line);
}
h3 { font-size: 1rem; margin: 2rem 0 .5rem; }
p, ul { margin: .7rem 0; max-width: 44rem; }
li { margin: .25rem 0; }
a { color: var(--mark); text-decoration-thickness: 1px; text-underline-offset: .15em; }
.meta { color: var(--soft); font-size: .875rem; line-height: 1.5; }
nav { font-size: .875rem; columns: 2; column-gap: 2rem; margin: 1.5rem 0 0; }
nav ol { margin: 0; padding-left: 1.4rem; }
nav li { margin: .15rem 0; break-inside: avoid; }
.table { margin: 1.6rem 0; overflow-x: auto; }
table {
  border-collapse: collapse; font-size: .84rem; line-height: 1.4; width: 100%;
  font-variant-numeric: tabular-nums lining-nums;
}
caption { caption-side: top; text-align: left; padding: 0 0 .5rem; font-size: .875rem; color: var(--ink); }
th, td {
  padding: .32rem .6rem; text-align: right; vertical-align: top; border-bottom: 1px solid var(--line);
}
th { font-weight: 600; vertical-align: bottom; border-bottom: 1.5px solid var(--soft); }
th:first-child, td:first-child { padding-left: .1rem; }
th:last-child, td:last-child { padding-right: .1rem; }
td { white-space: nowrap; }
th.text, td.text { text-align: left; white-space: normal; }
tr.strong td { background: var(--band); font-weight: 600; }
.note { color: var(--soft); font-size: .8rem; margin: .5rem 0 0; max-width: none; }
figure { margin: 1.8rem 0; break-inside: avoid; }
.picture { background: var(--picture); border: 1px solid var(--line); border-radius: 4px; padding: .6rem; }
.picture svg { display: block; width: 100%; height: auto; max-height: 60rem; }
figcaption { font-size: .84rem; line-height: 1.45; margin-top: .55rem; color: var(--ink); max-width: 48rem; }
td.met { color: var(--good); font-weight: 600; }
td.missed { color: var(--bad); font-weight: 600; }
@media (max-width: 40rem) { nav { columns: 1; } body { padding-top: 1.5rem; } }
@media print {
  :root {
    --ink: #000; --soft: #444; --page: #fff; --line: #bbb; --band: #f0f0f0; --mark: #000; --picture: #fff;
    --good: #17693a; --bad: #a12a16;
  }
  @page { size: A4; margin: 18mm 16mm; }
  body { max-width: none; padding: 0; font-size: 10pt; }
  nav { columns: 2; }
  h2 { break-after: avoid; margin-top: 2rem; }
  h3 { break-after: avoid; }
  .table, tr { break-inside: avoid; }
  .picture { border: 0; padding: 0; }
  .picture svg { max-height: 21cm; }
}
"""


def page(title: str, subtitle: str, sections: Sequence[Section]) -> str:
    """A whole document: style, contents and sections, without a reference to anything outside.

    Parameters
    ----------
    subtitle : plain text below the title.
    """
    contents = "".join(f'<li><a href="#{each.anchor}">{escape(each.title)}</a></li>' for each in sections)
    body = "\n".join(
        f'<section id="{each.anchor}">\n<h2>{number}. {escape(each.title)}</h2>\n{each.body}\n</section>'
        for number, each in enumerate(sections, start=1)
    )
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>{STYLE}</style>\n</head>\n<body>\n"
        f'<header>\n<h1>{escape(title)}</h1>\n<p class="meta">{escape(subtitle)}</p>\n</header>\n'
        f"<nav><ol>{contents}</ol></nav>\n<main>\n{body}\n</main>\n</body>\n</html>\n"
    )
