"""``python -m etac_ros`` is ``etac``."""

from etac_ros.cli.main import main

main()
