"""A stage's function by its name: code that only asks for keys and records need not import what computes them."""

from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from glint.tasks.engine.stage import Progress, StageFunction, StageOutput
    from glint.tasks.engine.stage_inputs import StageInputs


@dataclass(frozen=True, slots=True)
class ImportedFunction:
    """The function `name` of a module, which is imported at the first call."""

    module: str
    name: str

    def load(self) -> "StageFunction":
        """Import the module, which takes seconds, and return the function."""
        function: StageFunction = getattr(import_module(self.module), self.name)
        return function

    def __call__(self, inputs: "StageInputs", progress: "Progress", **options: Any) -> "StageOutput":
        """Compute the stage's result."""
        return self.load()(inputs, progress, **options)
