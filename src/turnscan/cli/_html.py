"""The HTML report of the verbs that write their own."""

from turnscan.workflows._html import findings, heading, page, paragraph, picture, png, table

__all__ = ["findings", "heading", "page", "paragraph", "picture", "png", "table"]
