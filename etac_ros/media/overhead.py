"""What a frame costs beside its payload, by the protocol that carries it; each number with its source."""

from __future__ import annotations

from enum import StrEnum
from typing import NamedTuple


class Profile(StrEnum):
    """Names of the protocols."""

    NONE = "none"
    PROXIMITY_1 = "ccsds-proximity-1"
    IEEE_802_15_4 = "ieee-802.15.4"
    IEEE_802_11 = "ieee-802.11"
    RTPS = "rtps-udp-ipv4-ethernet"


class Overhead(NamedTuple):
    """Bytes of a frame beside the payload.

    Attributes
    ----------
    frame_bytes
        Of every frame.
    smallest_bytes
        What a shorter frame is filled up to, the overhead included.
    preamble_ns
        Time on the air that is no byte at the link's rate.
    serialized
        Whether the payload on the air is the whole CDR serialization instead of the bare components.
    acknowledgement_bytes
        Of the whole frame of an acknowledgement; 0 where the protocol has none.
    """

    frame_bytes: int
    smallest_bytes: int = 0
    preamble_ns: int = 0
    serialized: bool = False
    acknowledgement_bytes: int = 0


# CCSDS 211.2-B-3 (Proximity-1, coding and synchronization): a PLTU is an attached synchronization marker of 24 bits
# (3.2.3.2), a transfer frame, and a CRC of 32 bits (3.2.5). CCSDS 211.0-B-6 (data link layer): the header of a
# version-3 frame has 40 bits (3.2.2.1); what acknowledges, the PLCW, is a fixed SPDU of 16 bits (3.2.4.3), here in a
# frame of its own.
_PROXIMITY_1 = Overhead(frame_bytes=3 + 5 + 4, acknowledgement_bytes=3 + 5 + 2 + 4)

# IEEE 802.15.4-2020, O-QPSK PHY at 2450 MHz (clause 12): preamble of 4 octets, SFD 1, PHR 1. MAC data frame (clause 7):
# frame control 2, sequence number 1, destination PAN 2, short destination 2 and source 2 (PAN compressed), FCS 2. An
# Imm-Ack frame has frame control, sequence number and FCS only.
_IEEE_802_15_4 = Overhead(frame_bytes=4 + 1 + 1 + 2 + 1 + 2 + 2 + 2 + 2, acknowledgement_bytes=4 + 1 + 1 + 2 + 1 + 2)

# IEEE 802.11-2020, data frame without QoS and address 4 (9.3.2): header 24, FCS 4; LLC and SNAP (IEEE 802.2) 8. The
# OFDM PHY (17.3): preamble 16 us and SIGNAL 4 us at 20 MHz, whatever the rate of what follows; before the frame the
# SERVICE field of 16 bits, and behind it a tail of 6 bits, here a whole octet. An Ack frame (9.3.1.4) has 14 octets.
_IEEE_802_11 = Overhead(frame_bytes=2 + 24 + 8 + 4 + 1, preamble_ns=20_000, acknowledgement_bytes=2 + 14 + 1)

# IEEE 802.3: preamble and SFD 8, header 14, FCS 4, interpacket gap of 12 octet times; a frame has at least 64, which
# with preamble and gap are 84. RFC 791: IPv4 header 20. RFC 768: UDP header 8. OMG DDSI-RTPS 2.5 (clause 9.4): header
# 20, INFO_TS 4 + 8, DATA without inline QoS 4 + 20; its payload is the CDR with the encapsulation header of 4. What
# acknowledges is INFO_DST 4 + 12 and ACKNACK 4 + 24: two entities, an empty set of sequence numbers, a count.
_ETHERNET_UDP = 8 + 14 + 4 + 12 + 20 + 8
_RTPS = Overhead(
    frame_bytes=_ETHERNET_UDP + 20 + 12 + 24,
    smallest_bytes=84,
    serialized=True,
    acknowledgement_bytes=_ETHERNET_UDP + 20 + 16 + 28,
)

OVERHEADS = {
    Profile.NONE: Overhead(0),
    Profile.PROXIMITY_1: _PROXIMITY_1,
    Profile.IEEE_802_15_4: _IEEE_802_15_4,
    Profile.IEEE_802_11: _IEEE_802_11,
    Profile.RTPS: _RTPS,
}
