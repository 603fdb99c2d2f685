"""``python -m etac_ros`` is ``etac``."""

from etac_ros.cli.entry import main

main()
