"""What the threshold of each mode is about: the paper's value in metres, or verified mode's confidence. Pure."""

from __future__ import annotations

from dataclasses import asdict, dataclass
from typing import Any, Protocol

from segmap.parameters import Parameters

__all__ = ["CRITERIA", "Criterion", "Measured"]


class Measured(Protocol):
    """Something a criterion looks at, such as a row of the queue."""

    @property
    def value(self) -> float | None: ...
    @property
    def confidence(self) -> float | None: ...


@dataclass(frozen=True)
class Criterion:
    """The quantity of an integration that a threshold lies on."""

    parameter: str
    """the parameter that is the threshold"""
    quantity: str
    """``value`` or ``confidence``: the field of a row, and what people call it"""
    unit: str
    maximum: float | None
    """the largest threshold there is; None: as large as one likes"""
    step: float
    inclusive: bool
    """whether a quantity just at the threshold is enough"""

    def threshold(self, parameters: Parameters) -> float:
        """The threshold in force."""
        return float(getattr(parameters, self.parameter))

    def of(self, measured: Measured) -> float | None:
        """The quantity of something, where it is known."""
        found = measured.confidence if self.quantity == "confidence" else measured.value
        return None if found is None else float(found)

    def moved(self, parameters: Parameters, threshold: float) -> Parameters:
        """The same parameters with another threshold. Raises ParameterError where it is out of bounds."""
        return parameters.replace(**{self.parameter: threshold})

    def to_json(self) -> dict[str, Any]:
        """As the pages get it."""
        return asdict(self)


CRITERIA = {
    "paper": Criterion("value_threshold", "value", "m", None, 0.05, inclusive=False),
    "verified": Criterion("confidence_accept", "confidence", "", 1.0, 0.01, inclusive=True),
}
"""By mode."""
