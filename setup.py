import os
from glob import glob
from pathlib import Path

from setuptools import find_packages, setup

NODES = ("plant", "sensor", "controller", "actuator", "recorder", "coordinator")

# The documentation site, which CI builds
DOCS = ["furo", "myst-parser", "numpydoc", "sphinx"]

# ROS 2 Jazzy for machines without ROS. There are wheels for CPython 3.11 and 3.12 on manylinux x86_64 only.
ROS_WHEELS = ["ros-jazzy-rclpy[fastrtps]", "ros-jazzy-common-interfaces"]


def jazzy_is_sourced() -> bool:
    """Whether this environment has a ROS 2 Jazzy of its own; scripts/setup goes by the same rule.

    A second rclpy from wheels beside it would mix two builds of the same libraries in one process. The share
    folder of the wheels themselves lies in a virtual environment, and does not count.
    """
    prefixes = os.environ.get("AMENT_PREFIX_PATH", "").split(os.pathsep)
    return os.environ.get("ROS_DISTRO") == "jazzy" and any(
        Path(prefix, "share/rclpy/package.xml").is_file() and not Path(prefix, "pyvenv.cfg").exists()
        for prefix in prefixes
        if prefix
    )


setup(
    name="etac_ros",
    version="0.1.0",  # as in package.xml and etac_ros/__init__.py
    description="Event-triggered attitude control of spacecraft as a graph of networked modules over ROS 2",
    maintainer="etac_ros maintainers",
    maintainer_email="maintainers@example.org",
    license="Apache-2.0",
    python_requires=">=3.11,<3.13",
    packages=find_packages(include=["etac_ros", "etac_ros.*"]),
    package_data={"etac_ros": ["**/*.js", "**/*.json", "**/*.xml", "**/*.yaml", "py.typed"]},
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/etac_ros"]),
        ("share/etac_ros", ["package.xml"]),
        ("share/etac_ros/config", sorted(glob("config/*.yaml"))),
        ("share/etac_ros/layouts", sorted(glob("share/*"))),
        ("share/etac_ros/launch", sorted(glob("launch/*.launch.py"))),
    ],
    install_requires=[
        "dpkt",
        "lz4",
        "matplotlib",
        "mcap>=1.5",
        "numba",
        "numpy",
        "plotly",
        "pyarrow",
        "pydantic>=2",
        "PyYAML",
        "rich",
        "rosbags",
        "scipy",
        "typer",
        "zstandard",
        *([] if jazzy_is_sourced() else ROS_WHEELS),
    ],
    extras_require={
        "browser": ["playwright"],  # and a Chromium: the slow tests of the report's page
        "cluster": ["distributed"],
        "live": ["foxglove-sdk"],
        "mutation": ["cosmic-ray"],
        "docs": DOCS,
        "test": [
            *DOCS,
            "colcon-common-extensions",
            "cyclonedds",
            "distributed",
            "foxglove-sdk",
            "hypothesis",
            "jsonschema",
            "mcap-ros2-support",
            "mypy",
            "pandas",
            "psutil",
            "pytest",
            "pytest-xdist",
            "ruff",
            "scapy",
            "types-PyYAML",
        ],
    },
    entry_points={
        "console_scripts": [
            "etac = etac_ros.cli.entry:main",
            *(f"{node} = etac_ros.cli.nodes:{node}" for node in NODES),
        ],
    },
    zip_safe=True,
)
