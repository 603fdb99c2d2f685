"""Which code of etac_ros a process runs: that of nodes that are started by hand, on several machines, has to agree."""

from __future__ import annotations

from functools import cache
from pathlib import Path

import etac_ros
from etac_ros.source_digest import digest_of_sources


@cache
def own_code() -> str:
    """The version, and a digest of all source files: working copies of one version may differ."""
    return f"{etac_ros.__version__}, {digest_of_sources([Path(etac_ros.__file__).parent])[:8]}"
