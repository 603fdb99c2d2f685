"""What is kept of a capture: its frames in a pcapng file, and its account in the metadata of the run's bag."""

from __future__ import annotations

from pathlib import Path

from pydantic import ValidationError

from etac_ros.bag.metadata import FILE_NAME, add_custom_data, read_custom_data
from etac_ros.capture.account import WireAccount
from etac_ros.capture.attribute import attribute
from etac_ros.capture.pcapng import read
from etac_ros.errors import BagError
from etac_ros.graph.graph import Graph, LinkKind

CUSTOM_DATA_KEY = "wire"


def account_of(path: Path, graph: Graph, missed: int = 0) -> WireAccount:
    """Account for the frames in a pcapng file.

    Parameters
    ----------
    path
        What was captured of one run.
    graph
        What ran.
    missed
        Frames that the system dropped meanwhile.

    Raises
    ------
    RunError
        If it cannot be read.
    """
    payloads = {
        link.topic: link.wire.payload_bytes for link in graph.links.values() if link.kind is not LinkKind.PHYSICAL
    }
    return attribute((frame for _, frame in read(path)), payloads, missed)


def write_to_bag(bag: Path, account: WireAccount) -> None:
    """Add an account to a finished bag: as ``custom_data``, which rosbag2 and others pass over.

    Raises
    ------
    BagError
        If the bag's metadata cannot be changed.
    """
    add_custom_data(bag, {CUSTOM_DATA_KEY: account.model_dump_json()})


def read_from_bag(bag: Path) -> WireAccount | None:
    """What was captured of the run of a bag; None where nothing was.

    Raises
    ------
    BagError
        If the bag says something else there.
    """
    text = read_custom_data(bag).get(CUSTOM_DATA_KEY)
    if text is None:
        return None
    try:
        return WireAccount.model_validate_json(text)
    except ValidationError as error:
        found = f"custom_data.{CUSTOM_DATA_KEY}: {error.errors()[0]['msg']}"
        raise BagError(str(bag / FILE_NAME), found, "what etac run --capture writes there") from None
