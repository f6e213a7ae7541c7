"""What the pydantic models of what is left for other programs have in common."""

from __future__ import annotations

from pydantic import BaseModel, ConfigDict


class ResultModel(BaseModel):
    """A part of a file for other programs. Fields of later versions are passed over."""

    model_config = ConfigDict(frozen=True, validate_by_name=True, serialize_by_alias=True)
