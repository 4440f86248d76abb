"""Drives of a camera at 30 Hz. A machine that is busy with something else for some seconds spoils one now and then: hence some
attempts, with a pause between them (`attempts`)."""

import json
import pathlib
import subprocess
import sys
import time

from cfodi_node import skipped

ATTEMPTS = 6
PAUSE = 5  # s
PLAY = pathlib.Path(__file__).with_name("play.py")
LEAST_RATE = 25  # that of a camera is 30


def attempts():
    """The numbers of the attempts, from 0 on, each but the first after a pause."""
    for number in range(ATTEMPTS):
        time.sleep(PAUSE if number else 0)
        yield number


def drive(node, pause, *arguments):
    """What the player has sent to the node, and the node's counts some time (s) later."""
    player = subprocess.run([sys.executable, str(PLAY), *arguments], stdout=subprocess.PIPE, timeout=180, check=True)
    played = json.loads(player.stdout)
    time.sleep(pause)
    counts = node.stop()
    print(played, counts)
    assert counts["received"] == counts["taken_in"] + counts["replaced"] + skipped(counts)
    return played, counts


def is_good(played, counts, share):
    """Whether at least this share was taken in, of a player that was fast enough for this to say anything."""
    return played["rate"] > LEAST_RATE and counts["taken_in"] >= share * played["sent"]
