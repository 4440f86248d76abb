"""Who is there while a node starts gets to know it before its topics."""

import itertools
import socket

import rtps

PREFIX = bytes.fromhex("010f00000000000000000001")
PORTS = range(7410, 7430, 2)  # where participants of domain 0 listen


def test_a_peer_hears_of_the_node_before_it_hears_of_its_topics(start):
    # The peer speaks without a pause: the node knows it as soon as it listens, and would tell it of topics at once.
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as peer:
        peer.bind(("127.0.0.1", 0))
        peer.settimeout(0.001)
        hello = rtps.introduction(PREFIX, peer.getsockname()[1])
        node = start()
        heard = []
        while rtps.PUBLICATIONS not in heard:
            assert node.process.poll() is None
            for port in PORTS:
                peer.sendto(hello, ("127.0.0.1", port))
            heard += answers(peer)
    topics = {rtps.PUBLICATIONS, rtps.SUBSCRIPTIONS}
    before = list(itertools.takewhile(lambda writer: writer not in topics, heard))
    assert rtps.PARTICIPANTS in before, "its topics came first"


def answers(peer):
    """Who has written what comes, until nothing does for a moment."""
    heard = []
    try:
        while True:
            heard += rtps.writers(peer.recv(1 << 16))
    except TimeoutError:
        return heard
