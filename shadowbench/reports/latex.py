"""The tables of a report in LaTeX, for the package booktabs."""

import re
from collections.abc import Sequence

from shadowbench.reports.html import Scenes
from shadowbench.reports.words import COLUMNS, COST_HEADINGS, cost_source, digits, section_notes, sentence
from shadowbench.results.configurations import Section

_SPECIAL = {
    **{character: f"\\{character}" for character in "&%$#_{}"},
    "\\": r"\textbackslash{}",
    "~": r"\textasciitilde{}",
    "^": r"\textasciicircum{}",
    "×": r"$\times$",
    "≥": r"$\geq$",
    "≤": r"$\leq$",
    "–": "--",
    "²": r"$^2$",
    "−": "$-$",
    "½": r"$\frac12$",
    "<": "$<$",
    ">": "$>$",
    "¼": r"$\frac14$",
    "…": r"\ldots{}",
    "|": r"$|$",
}


def latex_tables(scenes: Scenes) -> str:
    """A table environment for each section: its configurations, best first; the best of error and cost are bold."""
    tables = [_table(section) for parts in scenes.values() for section in parts if section.scored]
    return "\n".join(["% \\usepackage{booktabs}", *tables])


def _table(section: Section) -> str:
    costs: dict[str, str] = {COST_HEADINGS[section.cost_name]: section.cost_name} if section.ranked else {}
    columns = COLUMNS[section.soft] | costs | ({"× reference": "ratio"} if section.timed else {})
    best, rows = section.front, []
    for one in section.scored:
        name = rf"\texttt{{{escaped(one.name)}}}"
        values = [
            str(one.map_size or ""),
            one.error_text(digits),
            *(one.text(value, digits) for value in columns.values()),
        ]
        rows.append([rf"\textbf{{{name}}}" if one in best else name, *map(escaped, values)])
    headings = ["Setting", "Map", section.ranked_by.error_label, *columns]
    notes = [section.title, *([cost_source(section)] if section.ranked else []), *section_notes(section)]
    notes += ["bold: on the Pareto front of error and cost"] if best else []
    label = re.sub(r"[^a-z0-9]+", "-", f"{section.run.label}-{section.title}".lower()).strip("-")
    return "\n".join(
        [
            r"\begin{table}",
            r"  \centering",
            rf"  \caption{{{' '.join(escaped(sentence(note)) for note in notes)}}}",
            rf"  \label{{tab:{label}}}",
            rf"  \begin{{tabular}}{{ll{'r' * (len(headings) - 2)}}}",
            r"    \toprule",
            _line(list(map(escaped, headings))),
            r"    \midrule",
            *map(_line, rows),
            r"    \bottomrule",
            r"  \end{tabular}",
            r"\end{table}",
            "",
        ]
    )


def _line(cells: Sequence[str]) -> str:
    return f"    {' & '.join(cells)} \\\\"


def escaped(text: str) -> str:
    """Text in which no character has a meaning of its own to LaTeX."""
    return "".join(_SPECIAL.get(character, character) for character in " ".join(text.split()))
