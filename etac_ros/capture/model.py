"""A model of frames: what a message costs on the wire, from the length of its CDR and from who gets it.

It holds for data alone, each sample sent once: heartbeats and acknowledgements go by wall time, and by what is lost.
Fast DDS sends one frame to each process that has a receiver, in the order of the sum below. What is captured of an
ideal run agrees to the byte, which is a test.
"""

from __future__ import annotations

from etac_ros.capture.account import Layers
from etac_ros.capture.datagram import ETHERNET_BYTES, UDP_IP_BYTES
from etac_ros.capture.rtps import HEADER_BYTES, SUBMESSAGE_HEADER_BYTES

_INFO_DST = SUBMESSAGE_HEADER_BYTES + 12
"""Only where one process alone gets the sample: to several, the same message goes without (8.3.8.7.1)."""
_INFO_TS = SUBMESSAGE_HEADER_BYTES + 8
_DATA = SUBMESSAGE_HEADER_BYTES + 20
"""Flags, octetsToInlineQos, reader, writer, sequence number (9.4.5.4); no inline QoS."""
_STATISTICS = SUBMESSAGE_HEADER_BYTES + 56
"""Of Fast DDS where it was compiled with its statistics, as in the binaries of ROS 2 Jazzy."""


def data_frames(cdr_bytes: int, payload_bytes: int, receivers: int, others: int = 0, statistics: bool = True) -> Layers:
    """What one sample costs on its way to its receivers, each in a process of its own.

    Parameters
    ----------
    cdr_bytes
        Serialized message, encapsulation header included.
    payload_bytes
        Of these, the components of the value.
    receivers
        Processes that get it, by unicast.
    others
        Processes that get it as well, and are not counted here: the recorder.
    statistics
        Whether Fast DDS was compiled with its statistics.
    """
    aligned = -(-cdr_bytes // 4) * 4  # 9.4.1: submessages are aligned to 4 bytes
    alone = receivers + others == 1
    rtps = HEADER_BYTES + (_INFO_DST if alone else 0) + _INFO_TS + _DATA + (_STATISTICS if statistics else 0)
    counts = {
        "frames": receivers,
        "payload_bytes": receivers * payload_bytes,
        "cdr_bytes": receivers * (aligned - payload_bytes),
        "rtps_bytes": receivers * rtps,
        "udp_ip_bytes": receivers * UDP_IP_BYTES,
        "ethernet_bytes": receivers * ETHERNET_BYTES,
    }
    return Layers.of(counts)
