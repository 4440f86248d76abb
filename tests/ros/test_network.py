"""The network of the tests."""

import subprocess

import network
import pytest


def test_a_machine_that_no_wire_can_be_laid_to_does_not_stay(own_network, monkeypatch):
    started, begin = [], subprocess.Popen

    def noted(*arguments):
        started.append(begin(*arguments))
        return started[-1]

    def no_ip(*_, **__):
        raise FileNotFoundError("ip")

    monkeypatch.setattr(network.subprocess, "Popen", noted)
    monkeypatch.setattr(network, "_ip", no_ip)
    with pytest.raises(FileNotFoundError):
        network.OtherMachine("10.9.0.2")
    assert [machine.poll() is not None for machine in started] == [True]
