"""What can go wrong, said for the person who has to mend it."""

from __future__ import annotations

from etac_ros.plain_text import plain_text


class EtacError(Exception):
    """An error that is shown to the user without a traceback.

    Parameters
    ----------
    where
        The file, key, node or topic that is concerned.
    found
        What stands there.
    expected
        What should have stood there.
    remedy
        What to do about it.
    """

    def __init__(self, where: str, found: str, expected: str = "", remedy: str = "") -> None:
        self.where = where
        self.found = found
        self.expected = expected
        self.remedy = remedy
        parts = [f"{where}: {found}"]
        if expected:
            parts.append(f"  expected: {expected}")
        if remedy:
            parts.append(f"  to mend it: {remedy}")
        # Much of it was read from files of others.
        super().__init__(plain_text("\n".join(parts)))

    def __reduce__(self) -> tuple[type, tuple[str, str, str, str]]:
        # Errors cross process borders; the default would hand __init__ the joined text only.
        return type(self), (self.where, self.found, self.expected, self.remedy)


class ScenarioError(EtacError):
    """The scenario file, an override or a variant is not usable; nothing has been started."""


class ProtocolError(EtacError):
    """The time protocol was broken: a loop without delay, a message that nobody expected."""


class RunError(EtacError):
    """A run that had begun could not be finished."""


class RunHalted(RunError):
    """A watch ended the run at a committed tick, as a collision would."""


class CountMismatch(RunError):
    """Sent, received and recorded messages of a topic are not the same number."""


class OrderMismatch(RunError):
    """A module has not done what the time master laid down, or a value has changed on its way."""


class BagError(EtacError):
    """A bag cannot be written, read or repaired."""
