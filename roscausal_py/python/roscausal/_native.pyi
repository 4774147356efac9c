"""The native half of `roscausal`. Private: use the package."""

from collections.abc import Callable, Sequence
from os import PathLike
from typing import Any, TypedDict, final

import numpy as np
from numpy.typing import NDArray

__all__ = [
    "Cancelled",
    "DataError",
    "Frame",
    "SettingError",
    "Structural",
    "command",
    "demo",
    "discover",
    "export",
    "fdr_bh",
    "messages",
    "pdf",
    "picture",
    "read",
    "roll",
    "run",
    "run_test",
    "series",
    "version",
    "visible",
    "words",
]

class DataError(ValueError): ...
class SettingError(ValueError): ...
class Cancelled(ValueError): ...

class _Read(TypedDict):
    names: list[str]
    arrays: list[NDArray[np.float64]]
    dt: float | None
    exogenous: list[str]
    warnings: list[str]
    masked: list[NDArray[np.bool_]]

@final
class Frame:
    def __new__(
        cls,
        recordings: Sequence[NDArray[np.float64]],
        names: Sequence[str],
        masks: Sequence[NDArray[np.bool_]] | None = None,
        mask_type: str = "",
        remove_missing_upto_maxlag: bool = False,
        reference_points: Sequence[NDArray[np.bool_]] | None = None,
        vectors: Sequence[tuple[str, Sequence[int]]] = ...,
    ) -> Frame: ...
    def bootstrap(self, seed: int, number: int, block: str, first: int) -> Frame: ...

@final
class Structural:
    @staticmethod
    def fit(frame: Frame, graph: str, settings: str) -> Structural: ...
    @staticmethod
    def read(text: str) -> Structural: ...
    def to_json(self) -> str: ...
    def names(self) -> list[str]: ...
    def rows(self) -> list[int]: ...
    def what_if(self, question: str, recording: int, now: int) -> tuple[str, str]: ...
    def effect(self, cause: str, effect: str, max_lag: int, standardised: bool) -> tuple[str, str]: ...
    def explain(
        self, variable: str, recording: int, rows: tuple[int, int] | None, horizon: int, seed: int
    ) -> tuple[str, str]: ...

def discover(
    frame: Frame, settings: str, test: object | None = None, progress: Callable[[int, int], object] | None = None
) -> str: ...
def words() -> str: ...
def roll(
    frame: Frame, settings: str, length: int, step: int, progress: Callable[[int, int], object] | None = None
) -> tuple[list[tuple[int, int, int, str]], str]: ...
def run(
    frame: Frame, method: str, settings: str, test: object, progress: Callable[[int, int], object] | None = None
) -> dict[str, Any]: ...
def run_test(
    frame: Frame, test: object, x: tuple[int, int], y: tuple[int, int], z: Sequence[tuple[int, int]], cut_off: int
) -> tuple[float, float, tuple[float, float] | None, int, bool]: ...
def fdr_bh(p_matrix: NDArray[np.float64], tested: NDArray[np.bool_]) -> NDArray[np.float64]: ...
def export(model: str, what: str) -> str: ...
def series(names: Sequence[str], values: NDArray[np.float64], dt: float | None = None) -> str: ...
def pdf(svg: str) -> bytes: ...
def picture(svg: str, scale: float) -> bytes: ...
def read(paths: Sequence[str | PathLike[str]], options: Sequence[str]) -> _Read: ...
def demo(seed: int, out: str | PathLike[str]) -> str: ...
def command(args: Sequence[str]) -> int: ...
def messages() -> list[tuple[str, str]]: ...
def version() -> str: ...
def visible(text: str) -> str: ...
