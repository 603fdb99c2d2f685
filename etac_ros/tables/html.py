"""A table as HTML."""

from __future__ import annotations

from html import escape

from etac_ros.plain_text import one_line
from etac_ros.tables.table import Table


def html_section(table: Table) -> str:
    """A section with the table, its title above and its notes below."""
    texts = [table.is_text(place) for place in range(len(table.columns))]
    wide = bool(table.texts) and len(table.texts - {table.columns[0]}) == len(table.columns) - 1
    head = "".join(
        f'<th scope="col"{_class(text)}>{line(heading)}</th>'
        for heading, text in zip(table.columns, texts, strict=True)
    )
    lines = []
    for row in table.rows:
        first, *cells = row.cells
        body = f'<th scope="row" class="text">{line(first)}</th>'
        for cell, text in zip(cells, texts[1:], strict=True):
            body += f"<td{_class(text, wide)}>{line(cell)}</td>"
        lines.append(f'<tr class="strong">{body}</tr>' if row.strong else f"<tr>{body}</tr>")
    return "\n".join(
        [
            "<section>",
            f"<h2>{line(table.title)}</h2>",
            f'<div class="scroll" tabindex="0" role="region" aria-label="{escape(table.title)}">',
            f"<table><thead>{_groups(table)}<tr>{head}</tr></thead>",
            "<tbody>",
            *lines,
            "</tbody></table>",
            "</div>",
            *(f'<p class="note">{line(note)}</p>' for note in table.notes),
            "</section>",
        ]
    )


def line(text: str) -> str:
    """Text between tags."""
    return escape(one_line(text), quote=False)


def _groups(table: Table) -> str:
    cells = [
        f'<th scope="colgroup" colspan="{span}">{line(heading)}</th>' if heading else f'<td colspan="{span}"></td>'
        for heading, span in table.groups
    ]
    return f'<tr class="groups">{"".join(cells)}</tr>' if cells else ""


def _class(text: bool, wide: bool = False) -> str:
    names = [name for name, wanted in (("text", text), ("wide", wide)) if wanted]
    return f' class="{" ".join(names)}"' if names else ""
