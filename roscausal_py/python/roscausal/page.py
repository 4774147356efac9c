"""A model as HTML for notebooks: picture, table of links, warnings. No script, and nothing is loaded."""

from __future__ import annotations

from collections.abc import Sequence
from html import escape
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from .model import Model


def page(model: Model, level: str) -> str:
    """The HTML of a model, with the level that decided on its links."""
    settings = model.settings
    head = f"{settings['method']} with {settings['cond_ind_test']}, {level}, {settings['n_samples']} samples"
    cell = "<td style='text-align:left;padding:2px 8px'>{}</td>"

    def row(cells: Sequence[object]) -> str:
        return "<tr>" + "".join(cell.format(escape(str(each))) for each in cells) + "</tr>"

    resampled = model.link_frequency is not None
    rows = []
    for link in model.links:
        strength = "" if link.value is None else f"{link.value:.3f}"
        share = "" if link.confidence is None else f"{100 * link.confidence:.0f} %"
        rows.append(row([link.cause, link.mark, link.effect, link.lag, strength, link.p] + [share] * resampled))
    header = row(["cause", "", "effect", "lag", "strength", "p-value"] + ["found again"] * resampled)
    table = f"<table>{header}{''.join(rows)}</table>" if rows else "<p>No causal link found.</p>"
    status = "" if model.status == "complete" else f"<p><b>{escape(model.status)}</b></p>"
    notes = "".join(f"<li>{escape(warning)}</li>" for warning in model.warnings)
    listed = f"<ul>{notes}</ul>" if notes else ""
    return f"<div><p>{escape(head)}</p>{model.dag().svg}{table}{status}{listed}</div>"
