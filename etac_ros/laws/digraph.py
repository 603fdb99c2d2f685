"""Who hears whom: weighted directed graphs of a formation (xie2021 section 2.1).

``a_ij > 0`` where spacecraft i hears spacecraft j: row i lists the neighbours whose messages arrive at i, column j the
listeners of j. A root is a spacecraft whose messages reach all others, through others if need be; a graph with a root
has a directed spanning tree (assumption 1).

In code spacecraft count from 0; in what people read, from 1 as in the paper.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from etac_ros.maths.noise import stream_key, uniforms


@dataclass(frozen=True)
class Digraph:
    """A weighted directed graph without loops.

    Parameters
    ----------
    adjacency
        ``a_ij`` row by row, as nested sequences.

    Raises
    ------
    ValueError
        If the matrix is empty or not square, an entry is negative or not finite, or the diagonal is not zero. The text
        names row and column.
    """

    adjacency: tuple[tuple[float, ...], ...]

    def __post_init__(self) -> None:
        n = len(self.adjacency)
        if n == 0:
            raise ValueError("an adjacency matrix has at least one row")
        for i, row in enumerate(self.adjacency):
            if len(row) != n:
                raise ValueError(f"an adjacency matrix is square: row {i + 1} of {n} has {len(row)} entries")
            for j, weight in enumerate(row):
                where = f"row {i + 1}, column {j + 1} of the adjacency matrix is {weight:g}"
                if not (math.isfinite(weight) and weight >= 0.0):
                    raise ValueError(f"{where}: a weight is a finite number of at least 0")
                if i == j and weight != 0.0:
                    raise ValueError(f"{where}: spacecraft {i + 1} does not send to itself, the diagonal is 0")

    @classmethod
    def from_rows(cls, rows: Iterable[Iterable[float]]) -> Digraph:
        """The graph of an adjacency matrix given as any nested rows, an array for instance."""
        return cls(tuple(tuple(float(weight) for weight in row) for row in rows))

    @classmethod
    def from_flat(cls, values: Sequence[float]) -> Digraph:
        """The graph of a row-major list, as parameters have it.

        Raises
        ------
        ValueError
            If the list is no square matrix, or the matrix no adjacency matrix.
        """
        n = math.isqrt(len(values))
        if n * n != len(values):
            raise ValueError(
                f"an adjacency matrix is square, row by row: {n * n} or {(n + 1) ** 2} numbers, not {len(values)}"
            )
        return cls.from_rows(values[n * i : n * (i + 1)] for i in range(n))

    @property
    def size(self) -> int:
        """Number of spacecraft."""
        return len(self.adjacency)

    def in_neighbours(self, i: int) -> tuple[int, ...]:
        """Those whom spacecraft i hears, ascending."""
        return tuple(j for j, weight in enumerate(self.adjacency[i]) if weight > 0.0)

    def out_neighbours(self, i: int) -> tuple[int, ...]:
        """Those who hear spacecraft i, ascending."""
        return tuple(j for j, row in enumerate(self.adjacency) if row[i] > 0.0)

    def weights(self, i: int) -> tuple[float, ...]:
        """``a_ij`` of :meth:`in_neighbours`, in their order."""
        return tuple(weight for weight in self.adjacency[i] if weight > 0.0)

    def reached_from(self, i: int) -> frozenset[int]:
        """Those whom messages of spacecraft i reach, directly or through others, and i itself."""
        reached = {i}
        frontier = [i]
        while frontier:
            new = set(self.out_neighbours(frontier.pop())) - reached
            reached |= new
            frontier += new
        return frozenset(reached)

    def roots(self) -> tuple[int, ...]:
        """Every root, ascending; none if there is no directed spanning tree."""
        return tuple(i for i in range(self.size) if len(self.reached_from(i)) == self.size)

    def has_spanning_tree(self) -> bool:
        """Whether assumption 1 holds: at least one directed spanning tree."""
        return bool(self.roots())

    def require_spanning_tree(self) -> None:
        """Refuse a graph that violates assumption 1.

        Raises
        ------
        ValueError
            If there is no directed spanning tree. The text lists the candidates for a root, those whom nobody reaches
            but who reach them in turn, and for each whom it does not reach.
        """
        reach = [self.reached_from(i) for i in range(self.size)]
        if any(len(reached) == self.size for reached in reach):
            return
        lacks: list[str] = []
        for i in range(self.size):
            upstream = [j for j in range(self.size) if i in reach[j]]
            # Of candidates that reach each other, the first speaks for all.
            if upstream[0] == i and all(j in reach[i] for j in upstream):
                missing = sorted(set(range(self.size)) - reach[i])
                lacks.append(f"from {_named(upstream)} no message reaches {_named(missing)}")
        raise ValueError(
            "the graph has no directed spanning tree (assumption 1), no spacecraft whose messages reach all others: "
            + "; ".join(lacks)
        )


def ring_with_random_edges(n: int, extra: int, seed: int) -> Digraph:
    """A ring, each spacecraft heard by the next, and further edges drawn at random; every weight is 1.

    The ring makes every spacecraft a root. With the same seed, the edges for a smaller ``extra`` are among those for a
    larger one. The draws are raw words of a Philox generator, which no release of numpy changes.

    Parameters
    ----------
    n
        Number of spacecraft; one alone has no edge.
    extra
        Number of further edges, without repetition.
    seed
        Of the draws.

    Raises
    ------
    ValueError
        If there are no spacecraft, or not so many further edges.
    """
    if n < 1:
        raise ValueError(f"a formation has at least one spacecraft, not {n}")
    ring = {(i, (i - 1) % n) for i in range(n)} if n > 1 else set()
    free = [(i, j) for i in range(n) for j in range(n) if i != j and (i, j) not in ring]
    if not 0 <= extra <= len(free):
        raise ValueError(f"a ring of {n} spacecraft has room for 0 to {len(free)} further edges, not {extra}")
    draws = uniforms(stream_key(seed, f"digraph/{n}"), 0, 1, extra)[0]
    for k in range(extra):
        other = k + int(draws[k] * (len(free) - k))
        free[k], free[other] = free[other], free[k]
    edges = ring | set(free[:extra])
    return Digraph.from_rows([float((i, j) in edges) for j in range(n)] for i in range(n))


def _named(spacecraft: Sequence[int]) -> str:
    """Spacecraft in words, counted from 1."""
    return "spacecraft " + ", ".join(str(i + 1) for i in spacecraft)
