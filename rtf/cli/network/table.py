"""Tables of the tools: aligned text for programs and files, with rules and colours on a terminal."""

from __future__ import annotations

import sys
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rich.table import Table as RichTable

#: Colours of cells that are worth one.
_STYLES = {"yes": "green", "no": "bold red"}


@dataclass
class Table:
    """Rows of text below headings; ``numbers`` are the columns that are aligned on the right."""

    headings: Sequence[str]
    rows: list[Sequence[str]] = field(default_factory=list)
    numbers: Sequence[str] = ()
    title: str = ""

    def to_text(self) -> str:
        """Aligned columns, two blanks between them."""
        rows = [self.headings, *self.rows]
        widths = [max(len(row[column]) for row in rows) for column in range(len(self.headings))]
        right = [heading in self.numbers for heading in self.headings]
        lines = [
            "  ".join(
                cell.rjust(width) if to_right else cell.ljust(width)
                for cell, width, to_right in zip(row, widths, right, strict=True)
            ).rstrip()
            for row in rows
        ]
        return "\n".join([self.title, *lines] if self.title else lines)

    def to_rich(self) -> RichTable:
        """The same for a terminal."""
        from rich import box
        from rich.table import Table as RichTable
        from rich.text import Text

        table = RichTable(title=self.title or None, title_justify="left", box=box.SIMPLE_HEAD, pad_edge=False)
        for heading in self.headings:
            table.add_column(heading, justify="right" if heading in self.numbers else "left", overflow="fold")
        for row in self.rows:
            table.add_row(*(Text(cell, style=_STYLES.get(cell, "")) for cell in row))
        return table


def show(*tables: Table) -> None:
    """Print tables, a blank line between them."""
    if sys.stdout.isatty():
        from rich.console import Console

        Console().print(*(table.to_rich() for table in tables), sep="")
    else:
        print("\n\n".join(table.to_text() for table in tables), flush=True)
