"""JSON documents: each is one pydantic model, from which it is dumped and its schema derived."""

from __future__ import annotations

from typing import Any

from pydantic import BaseModel, ConfigDict


class Document(BaseModel):
    """A JSON object without further keys; the strings after its fields describe them."""

    model_config = ConfigDict(extra="forbid", use_attribute_docstrings=True)

    def dump(self) -> dict[str, Any]:
        """The document as JSON data."""
        return self.model_dump(mode="json")
