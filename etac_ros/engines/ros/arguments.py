"""The ROS part of a node's command line, read by rcl's own parser and asked of it: nothing is parsed a second time.

rcl tells what a name becomes only of a node that exists, so one is made for as long as the questions last. It has no
topics, and its participant is gone when the node itself joins. What rcl does not tell - which words are files, which
are for its logging - is found by the names of the options, in words that rcl has accepted.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from types import TracebackType
from typing import Any, Self

from rclpy.context import Context
from rclpy.impl.implementation_singleton import rclpy_implementation as _rclpy
from rclpy.impl.logging_severity import LoggingSeverity
from rclpy.logging import set_logger_level
from rclpy.parameter import Parameter

from etac_ros.errors import ScenarioError

_ARGS, _END = "--ros-args", "--"
_FILE = ("--params-file",)
_PARAMETER = ("-p", "--param")
_PASSED_ON = ("--log-level", "--log-config-file", "--log-file-name", "-e", "--enclave")
_LOG_FLAGS = tuple(
    f"--{what}-{kind}-logs" for what in ("enable", "disable") for kind in ("rosout", "stdout", "external-lib")
)


class RosArguments:
    """What the words behind ``--ros-args`` say to one node. A context manager: questions are asked within it.

    Parameters
    ----------
    executable
        Gives the node its name unless it is remapped.
    arguments
        All of the command line.
    domain
        The ROS domain; the environment has been prepared for it.

    Attributes
    ----------
    name
        Full name of the node, after all remaps.
    others
        The words that are none of ROS's.
    params_files
        Paths, in their order.
    passed_on
        What is for the node's own logging and security, as arguments for ``rclpy.init``.

    Raises
    ------
    ScenarioError
        If rcl does not understand them, in its words.
    """

    def __init__(self, executable: str, arguments: Sequence[str], domain: int) -> None:
        self._executable = executable
        words = [executable, *arguments]
        self._context = Context()
        set_logger_level("rcl", LoggingSeverity.FATAL)  # we say it
        try:
            self._context.init(words, initialize_logging=False, domain_id=domain)
            self._node = self._made(executable, "", None)
        except _rclpy.UnknownROSArgsError as error:
            raise ScenarioError(f"{executable}: {error}", "is not understood by ROS", "what --help says") from None
        except _rclpy.RCLError as error:
            found, _, rest = str(error).removeprefix("failed to initialize rcl: ").partition(". Error: ")
            why = rest.partition(", at ")[0]
            said = f"ROS says: {found.partition(', at ')[0]}{why and f' ({why})'}"
            raise ScenarioError(executable, said, "arguments as any ROS node takes them") from None
        finally:
            set_logger_level("rcl", LoggingSeverity.UNSET)
        self.name: str = self._node.get_fully_qualified_name()
        self.others: list[str] = _rclpy.rclpy_remove_ros_args(words)[1:]
        of_ros = list(_of_ros(arguments))
        self.params_files = tuple(value for name, value in of_ros if name in _FILE)
        self.passed_on = tuple(word for name, value in of_ros if name in (*_PASSED_ON, *_LOG_FLAGS)
                               for word in (name, value) if word)  # fmt: skip
        self._rules = [word for name, value in of_ros if name in _PARAMETER for word in (name, value)]

    def _made(self, name: str, namespace: str, arguments: Sequence[str] | None) -> Any:
        """A node that goes by these arguments, or by those of the whole command line."""
        handle = self._context.handle
        assert handle is not None
        with handle:
            return _rclpy.Node(name, namespace, handle, arguments, arguments is None, False)

    def overridden(self) -> dict[str, Any]:
        """Parameters of this node that the command line itself gives, with their values."""
        only = self._made(self._node.get_node_name(), self._node.get_namespace(), [_ARGS, *self._rules])
        with only:
            return {name: parameter.value for name, parameter in only.get_parameters(Parameter).items()}

    def remapped(self, topics: Iterable[str]) -> dict[str, str]:
        """Of these topics, those that would have another name for this node, and which."""
        with self._node:
            found = {topic: str(_rclpy.rclpy_remap_topic_name(self._node, topic)) for topic in topics}
        return {topic: name for topic, name in found.items() if name != topic}

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def close(self) -> None:
        """Let the node go."""
        self._node.destroy_when_not_in_use()
        self._context.try_shutdown()
        self._context.destroy()


def _of_ros(arguments: Sequence[str]) -> Iterator[tuple[str, str]]:
    """Options behind ``--ros-args``, with their values; empty where they have none."""
    words, inside = iter(arguments), False
    for word in words:
        if word == _ARGS:
            inside = True
        elif word == _END:
            inside = False
        elif inside:
            yield word, "" if word in _LOG_FLAGS else next(words, "")
