"""Repairing a bag that was cut off or damaged."""

from __future__ import annotations

import os
import shutil
import tempfile
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from etac_ros.bag.contents import Contents, mcap_file
from etac_ros.bag.lock import alone_with
from etac_ros.bag.metadata import FILE_NAME
from etac_ros.bag.read import check_origin, read_file
from etac_ros.bag.records import DamagedBagError
from etac_ros.bag.run_metadata import RECOVERED
from etac_ros.bag.state_rest import StateRest
from etac_ros.bag.write import BagWriter, check_writable
from etac_ros.errors import BagError


@dataclass(frozen=True)
class RecoverReport:
    """What became of a bag.

    Attributes
    ----------
    bag
        The bag that can be read now.
    nothing_to_do
        The bag was whole; nothing was written.
    found
        What was wrong with it.
    messages
        What was saved: messages by topic.
    original
        Where the file is kept as it was found; None if it still stands in its place.
    """

    bag: Path
    nothing_to_do: bool
    found: str
    messages: dict[str, int]
    original: Path | None


Completing = Callable[[Contents], StateRest | None]
"""Makes what completes the state in a bag, given what the bag is; None where that cannot be."""


def recover(
    directory: Path, output: Path | None = None, completing: Completing = lambda contents: None
) -> RecoverReport:
    """Make a readable bag of all that was whole before the first damage.

    A recording is useful only without gaps, so what stands behind the damage is left out.

    Parameters
    ----------
    directory
        The bag.
    output
        Directory of the repaired bag. By default the bag is repaired in its place, all at once, and its file
        as it was found is kept beside it with ``.cut`` added to its name.
    completing
        Completes the state of the bodies, which waits for a second to be written, and follows from what is there.

    Raises
    ------
    BagError
        If there is no bag, somebody still writes it, not one message of it is whole, or the repaired one cannot be
        written.
    """
    path = mcap_file(directory)
    with alone_with(path):
        return _recovered(directory, path, output, completing)


def _recovered(directory: Path, path: Path, output: Path | None, completing: Completing) -> RecoverReport:
    try:
        bag = read_file(directory, path)
    except BagError as error:
        found = error.found
    else:
        counts = {topic.name: count.messages for topic, count in bag.topics.items()}
        return RecoverReport(directory, True, "", counts, None)
    if output is not None:
        check_writable(output)
        found, counts = _copy(path, output, found, completing)
        return RecoverReport(output, False, found, counts, None)
    try:
        temporary = Path(tempfile.mkdtemp(prefix=".recover-", dir=directory))
    except OSError as error:
        raise _unwritable(directory, error) from error
    try:
        # rosbag2 names the file after its directory, so this copy's file gets the name that it will keep.
        copy = temporary / path.stem.removesuffix("_0")
        found, counts = _copy(path, copy, found, completing)
        original = _put_in_place(copy, path)
    except OSError as error:
        raise _unwritable(directory, error) from error
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
    return RecoverReport(directory, False, found, counts, original)


def _copy(path: Path, output: Path, found: str, completing: Completing) -> tuple[str, dict[str, int]]:
    """Write all that is whole into a new bag; say what ended it, and how many messages that were."""
    contents = Contents(path)
    whole = 0
    try:
        for _ in contents.messages():
            whole += 1
    except DamagedBagError as damage:
        found = damage.found
    if whole == 0:
        raise BagError(str(path), f"no message in it is whole ({found})", "one at least", "nothing can be saved")
    check_origin(contents)
    topics = list(contents.topics.values())
    counts = {topic.name: 0 for topic in topics}
    state = completing(contents)
    with BagWriter(output, topics, contents.attachments, {RECOVERED: found, **contents.metadata}) as writer:
        messages = Contents(path).messages()
        for _ in range(whole):
            message = next(messages)
            topic, log_time, publish_time, sequence, cdr = message
            writer.write(topic.name, cdr, log_time, publish_time, sequence)
            counts[topic.name] += 1
            if state is not None:
                state.take(message)
        for name, cdr, log_time, publish_time, sequence in () if state is None else state.rest():
            writer.write(name, cdr, log_time, publish_time, sequence)
            counts[name] += 1
    return found, counts


def _put_in_place(copy: Path, path: Path) -> Path:
    """Replace the file, then the metadata; at every moment the old file or the new one is there."""
    original = _free_name(path)
    try:
        os.link(path, original)
    except OSError:  # a file system without hard links
        shutil.copy2(path, original)
    (fresh,) = copy.glob("*.mcap")
    os.replace(fresh, path.with_name(fresh.name))
    if fresh.name != path.name:
        path.unlink()
    os.replace(copy / FILE_NAME, path.parent / FILE_NAME)
    return original


def _free_name(path: Path) -> Path:
    """``NAME.mcap.cut``, or with a number behind it if the bag was repaired before."""
    candidate = path.with_name(f"{path.name}.cut")
    number = 1
    while candidate.exists():
        number += 1
        candidate = path.with_name(f"{path.name}.cut{number}")
    return candidate


def _unwritable(directory: Path, error: OSError) -> BagError:
    found = f"cannot be repaired in its place: {error.strerror}"
    return BagError(str(directory), found, "a directory that may be written to", "name another output")
