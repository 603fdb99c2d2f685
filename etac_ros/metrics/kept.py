"""The figures of all samples, kept in a bag that does not keep all samples."""

from __future__ import annotations

import json
from pathlib import Path

from pydantic import ValidationError

from etac_ros.bag.metadata import FILE_NAME, add_custom_data, read_custom_data
from etac_ros.errors import BagError
from etac_ros.metrics.summary import SampleFigures, Summary, figures_of_samples

CUSTOM_DATA_KEY = "of_samples"


def keep_in_bag(bag: Path, summary: Summary) -> None:
    """Add them to a finished bag: as ``custom_data``, which rosbag2 and others pass over.

    Raises
    ------
    BagError
        If the bag's metadata cannot be changed.
    """
    add_custom_data(bag, {CUSTOM_DATA_KEY: json.dumps(figures_of_samples(summary).model_dump(mode="python"))})


def kept_in_bag(bag: Path) -> SampleFigures:
    """The figures of all samples of a run of which the bag keeps only a part.

    Raises
    ------
    BagError
        If they are not there, or make no sense.
    """
    text = read_custom_data(bag).get(CUSTOM_DATA_KEY)
    if text is None:
        raise BagError(
            str(bag),
            "it keeps only a part of the committed samples (--truth), and its run did not come to sum up all of them",
            "a run that has ended, or one whose bag keeps all samples",
            "record the run anew; etac info shows what is in this bag",
        )
    try:
        return SampleFigures.model_validate(json.loads(text))
    except (ValidationError, ValueError, RecursionError) as error:
        found = f"custom_data.{CUSTOM_DATA_KEY}: {str(error).splitlines()[0]}"
        raise BagError(str(bag / FILE_NAME), found, "what etac run --truth writes there") from None
