"""Every node of a scenario as a process of its own.

    ros2 launch etac_ros scenario.launch.py scenario:=wu2018 bag:=/tmp/bag

``scenario`` is a name, or a file that ``etac resolve`` printed, with its variant and overrides.
"""

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument, OpaqueFunction
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import Node

from etac_ros.scenario.load import load


def nodes(context):
    scenario = load(LaunchConfiguration("scenario").perform(context))
    bag = LaunchConfiguration("bag").perform(context)
    # A module class of the user's own needs no executable of its own: which node it plays is in the name.
    executables = {
        name: node["module"] if ":" not in node["module"] else "controller"
        for name, node in scenario.nodes.items()
        if not node.get("external")
    }
    executables["/recorder"] = "recorder"
    if len(scenario.build().plants) > 1:
        executables["/coordinator"] = "coordinator"
    return [
        Node(
            package="etac_ros",
            executable=executable,
            namespace=name.rpartition("/")[0] or "/",
            name=name.rpartition("/")[2],
            parameters=[str(scenario.path.resolve())],
            arguments=["--bag", bag] if bag and name == "/recorder" else [],
            output="screen",
        )
        for name, executable in executables.items()
    ]


def generate_launch_description():
    return LaunchDescription(
        [
            DeclareLaunchArgument("scenario", default_value="wu2018", description="name or file"),
            DeclareLaunchArgument("bag", default_value="", description="folder; default: one in bags/"),
            OpaqueFunction(function=nodes),
        ]
    )
