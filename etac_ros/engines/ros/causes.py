"""No answer before its question: the proof that a foreign node publishes by itself, and not because it was asked."""

from __future__ import annotations

from collections import deque


class Causes:
    """Questions and answers of one foreign node, in their order, each with the time at which it was published.

    The times are those that DDS stamps on a message when it is handed over, of one machine's clock; so an answer that
    was published before its question cannot have been caused by it, however late either of them is read.
    """

    def __init__(self) -> None:
        self._questions: deque[int] = deque()
        self._answers: deque[int] = deque()
        self._compared = 0

    @property
    def settled(self) -> bool:
        """Whether each answer that has come has been compared with its question."""
        return not self._answers

    def question(self, published_ns: int) -> tuple[int, int] | None:
        """A question was published; returns the first answer that comes before its own, as :meth:`answer` does."""
        self._questions.append(published_ns)
        return self._compare()

    def answer(self, published_ns: int) -> tuple[int, int] | None:
        """An answer was published.

        Returns
        -------
        tuple of int or None
            Number of the first answer that was published before its question, 1 for the first one, and how long
            before [ns]; None if there is none among those of which both are known.
        """
        self._answers.append(published_ns)
        return self._compare()

    def _compare(self) -> tuple[int, int] | None:
        while self._questions and self._answers:
            early_ns = self._questions.popleft() - self._answers.popleft()
            self._compared += 1
            if early_ns > 0:
                return self._compared, early_ns
        return None
