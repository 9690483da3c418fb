"""What all bodies of requests are made of."""

from __future__ import annotations

from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field

__all__ = ["Body", "IntegrationId", "Name", "Rank", "Revision", "Scalar", "Text"]

Text = Annotated[str, Field(max_length=10_000)]
Name = Annotated[str, Field(max_length=255)]
IntegrationId = Annotated[str, Field(max_length=64)]
Revision = Annotated[int, Field(ge=0, le=2**53)]
Rank = Annotated[int, Field(ge=0, le=2**31)]
Scalar = bool | int | float | Name | None


class Body(BaseModel):
    model_config = ConfigDict(extra="forbid", allow_inf_nan=False)
