"""What an interrupted ``etac reproduce`` has measured, so that the same command goes on."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from contextlib import suppress
from hashlib import sha256
from pathlib import Path

from etac_ros import __version__
from etac_ros.errors import ScenarioError
from etac_ros.metrics.figures import FigureKey
from etac_ros.scenario.load import Scenario

_FOLDER = Path("reproduce")

Measured = Mapping[FigureKey, float]


class Kept:
    """Measured figures of whole variants, each written as soon as it is there.

    Parameters
    ----------
    scenarios
        All variants that are to be measured: other ones, or other contents of theirs, have another file.
    engine
        What measures.
    folder
        Where the file stands until all is done.
    """

    def __init__(self, scenarios: Sequence[Scenario], engine: str, folder: Path = _FOLDER) -> None:
        same = [__version__, engine, *((scenario.variant, scenario.text) for scenario in scenarios)]
        self.path = folder / f"{engine}_{sha256(repr(same).encode()).hexdigest()[:8]}.jsonl"
        self._measured: dict[tuple[str, str], dict[FigureKey, float]] = {}
        if self.path.exists():
            self._read()

    def __len__(self) -> int:
        return len(self._measured)

    def of(self, scenario: Scenario) -> Measured | None:
        """What a variant has measured; None if it has not been run."""
        return self._measured.get(_name(scenario))

    def add(self, scenario: Scenario, measured: Measured) -> None:
        """Keep what a variant has measured.

        Raises
        ------
        ScenarioError
            If it cannot be written.
        """
        self._measured[_name(scenario)] = dict(measured)
        line = json.dumps([*_name(scenario), {str(key): float(value) for key, value in measured.items()}])
        try:
            self.path.parent.mkdir(exist_ok=True)
            with self.path.open("a", encoding="utf-8") as file:
                file.write(line + "\n")
        except OSError as error:
            raise ScenarioError(
                str(self.path), f"cannot be written ({error.strerror})", "a folder to keep finished variants in"
            ) from None

    def forget(self) -> None:
        """All is done, or is to be measured anew."""
        self._measured.clear()
        self.path.unlink(missing_ok=True)
        with suppress(OSError):  # others are at work in it
            self.path.parent.rmdir()

    def _read(self) -> None:
        for line in self.path.read_text(encoding="utf-8").splitlines():
            with suppress(ValueError, TypeError):  # the last line may have been cut off
                name, variant, figures = json.loads(line)
                self._measured[name, variant] = {FigureKey.parse(key): float(value) for key, value in figures.items()}


def _name(scenario: Scenario) -> tuple[str, str]:
    return scenario.name, scenario.variant or ""
