"""HTML of the pages: one reader of Markdown and one of templates. Neither lets foreign HTML pass."""

from functools import cache

import jinja2
import markdown_it

from study.core.registry import ROOT

TEMPLATES = ROOT / "report" / "templates"


@cache
def markdown() -> markdown_it.MarkdownIt:
    """CommonMark with tables; HTML in it is shown, not obeyed, and pictures are left out."""
    return markdown_it.MarkdownIt("commonmark", {"html": False}).enable("table").disable("image")


@cache
def _words() -> markdown_it.MarkdownIt:
    return markdown_it.MarkdownIt("zero").enable(["backticks", "emphasis"])


def prose(text: str) -> str:
    """A paragraph that a run's file has: code and emphasis, no links."""
    return _words().renderInline(text)


@cache
def templates() -> jinja2.Environment:
    """Those of report/templates; what is put in is escaped, and a name that is not known is an error."""
    return jinja2.Environment(
        loader=jinja2.FileSystemLoader(TEMPLATES),
        autoescape=True,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
