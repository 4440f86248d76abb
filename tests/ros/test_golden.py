"""tests/golden holds what real ROS 2 writes."""

import pytest
from rclpy.serialization import deserialize_message

import golden


@pytest.mark.parametrize("name", golden.MESSAGES)
def test_the_committed_bytes_are_those_that_ros_2_writes(name):
    message = golden.MESSAGES[name]
    committed = (golden.FOLDER / f"{name}.cdr").read_bytes()
    assert committed == golden.canonical(message)
    assert deserialize_message(committed, type(message)) == message


def test_the_committed_table_holds_the_values_of_the_messages():
    assert (golden.FOLDER / "README.md").read_text() == golden.table()
    files = {path.stem for path in golden.FOLDER.glob("*.cdr")}
    assert files == set(golden.MESSAGES)
