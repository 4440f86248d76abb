"""Arguments and parameter files mean here what they mean to rclpy, which hands them to the same library as rclcpp."""

import pytest
import rclpy
from test_introspection import parameters

# Arguments; `{file}` stands for a file of the text behind them. The first element names the case.
CASES = {
    "for all": ("--params-file {file}", "/**: {ros__parameters: {depth: 3}}"),
    "for all of the root": ("--params-file {file}", "/*: {ros__parameters: {depth: 3}}"),
    "for all of the root, elsewhere": ("-r __ns:=/robot --params-file {file}", "/*: {ros__parameters: {depth: 3}}"),
    "by name": ("--params-file {file}", "cfodi: {ros__parameters: {depth: 3}}"),
    "by name with a slash": ("--params-file {file}", "/cfodi: {ros__parameters: {depth: 3}}"),
    "by name, elsewhere": ("-r __ns:=/robot --params-file {file}", "cfodi: {ros__parameters: {depth: 3}}"),
    "by name anywhere": ("-r __ns:=/a/b --params-file {file}", "/**/cfodi: {ros__parameters: {depth: 3}}"),
    "by name one below": ("-r __ns:=/robot --params-file {file}", "/*/cfodi: {ros__parameters: {depth: 3}}"),
    "by name one below, two below": ("-r __ns:=/a/b --params-file {file}", "/*/cfodi: {ros__parameters: {depth: 3}}"),
    "for all of a namespace": ("-r __ns:=/robot --params-file {file}", "/robot/*: {ros__parameters: {depth: 3}}"),
    "for all below": ("-r __ns:=/a/b --params-file {file}", "/a/**: {ros__parameters: {depth: 3}}"),
    "for all of another": ("-r __ns:=/a/b --params-file {file}", "/a/*: {ros__parameters: {depth: 3}}"),
    "nested namespace": ("-r __ns:=/robot --params-file {file}", "robot: {cfodi: {ros__parameters: {depth: 3}}}"),
    "nested namespace with a slash": ("-r __ns:=/robot --params-file {file}", "/robot: {cfodi: {ros__parameters: {depth: 3}}}"),
    "nested below all": ("-r __ns:=/a/b --params-file {file}", "/**: {cfodi: {ros__parameters: {depth: 3}}}"),
    "nested, another namespace": ("--params-file {file}", "robot: {cfodi: {ros__parameters: {depth: 3}}}"),
    "renamed": ("-r __node:=eyes --params-file {file}", "eyes: {ros__parameters: {depth: 3}}"),
    "renamed, the name before": ("-r __node:=eyes --params-file {file}", "cfodi: {ros__parameters: {depth: 3}}"),
    "the later counts": ("--params-file {file}", "/**: {ros__parameters: {depth: 3}}\ncfodi: {ros__parameters: {depth: 5}}"),
    "the later counts, turned": ("--params-file {file}", "cfodi: {ros__parameters: {depth: 5}}\n/**: {ros__parameters: {depth: 3}}"),
    "two sections of one name": (
        "--params-file {file}", "/**: {ros__parameters: {depth: 3, max_range: 5.0}}\n/**: {ros__parameters: {depth: 5}}"),
    "a parameter twice": ("--params-file {file}", "/**: {ros__parameters: {depth: 3, max_range: 5.0, depth: 6}}"),
    "twice the file": ("--params-file {file} --params-file {file}", "/**: {ros__parameters: {depth: 3}}"),
    "-p after a file": ("--params-file {file} -p depth:=2", "/**: {ros__parameters: {depth: 3}}"),
    "-p for the node": ("--params-file {file} -p cfodi:depth:=2", "/**: {ros__parameters: {depth: 3}}\ncfodi: {ros__parameters: {depth: 5}}"),
    "-p for another node": ("-p other:depth:=2", ""),
    "-p for the node, elsewhere": ("-r __ns:=/robot -p cfodi:depth:=2", ""),
    "-p twice": ("-p depth:=2 -p depth:=6", ""),
    "a name twice": ("-r __node:=eyes -r __node:=ears -r __ns:=/robot -r __ns:=/other", ""),
    "a namespace for the new name": ("-r __node:=eyes -r eyes:__ns:=/robot -r cfodi:__ns:=/other", ""),
    "the name of a log file": ("--log-file-name cfodi -p depth:=2", ""),
    "words": ("-p clearing:=off -p use_sim_time:=Yes", ""),
    "words in a file": ("--params-file {file}", "/**: {ros__parameters: {clearing: n, use_sim_time: ON, mode: consistent}}"),
    "numbers": ("-p max_voxels:=0x10 -p keep_radius:=3 -p tf_timeout:=.5 -p max_range:=1e1 -p min_range:=1.", ""),
    "texts": ("-p fixed_frame:=oN -p snapshot_path:=''", ""),
    "lists": ("--params-file {file}", "/**: {ros__parameters: {network_interfaces: [127.0.0.1]}}"),
}


def by_rclpy(arguments):
    """What a node of rclpy of the same name gets."""
    context = rclpy.Context()
    rclpy.init(args=["--ros-args", *arguments], context=context)
    try:
        node = rclpy.create_node("cfodi", context=context, automatically_declare_parameters_from_overrides=True)
        found = {n: p.value for n, p in node._parameters.items() if n != "start_type_description_service"}
        fully_qualified_name = node.get_fully_qualified_name()
        node.destroy_node()
        return fully_qualified_name, found
    finally:
        context.try_shutdown()


@pytest.mark.parametrize("case", CASES)
def test_arguments_and_files_give_what_they_give_to_rclpy(case, start, new_peer, tmp_path):
    arguments, text = CASES[case]
    (tmp_path / "params.yaml").write_text(text)
    arguments = [a.replace("{file}", str(tmp_path / "params.yaml")).replace("''", '""') for a in arguments.split()]
    name, expected = by_rclpy(arguments)
    start(fixed_frame=None, points=None, arguments=arguments).ready(name)
    assert parameters(new_peer(), {"depth": 4} | expected, name) == {"depth": 4} | expected


def test_a_file_for_all_nodes_of_a_robot_may_have_what_every_node_has(start, tmp_path):
    """rclcpp declares these by itself."""
    path = tmp_path / "robot.yaml"
    path.write_text("/**:\n  ros__parameters:\n    start_type_description_service: false\n"
                    "    qos_overrides:\n      /tf:\n        publisher:\n          depth: 10\n")
    node = start(arguments=["--params-file", str(path)]).ready()
    for name in ("start_type_description_service", "qos_overrides"):
        node.line_with(f"the parameter {name} has no effect on this node")
    node.stop()


REFUSED = {
    "voxelsize": ("0.1", ["unknown parameter `voxelsize`", "`voxel_size`"]),
    "publish_rat": ("1.0", ["unknown parameter `publish_rat`", "`publish_rate`"]),
    "voxel_size": ("wide", ["voxel_size is \"wide\"", "a number"]),
    "depth": ("3.5", ["depth is 3.5", "an integer"]),
    "min_points": ("0", ["min_points is 0", "from 1 to 2147483648"]),
    "clearing": ("3", ["clearing is 3", "true or false"]),
    "optical": ("3", ["optical is 3", "`auto`, `yes` or `no`"]),
    "max_range": ("0.1", ["max_range is 0.1", "at least min_range, which is 0.4 m"]),
    "snapshot_period": ("[1, 2]", ["snapshot_period is", "a number"]),
}


@pytest.mark.parametrize("way", ["file", "-p"])
@pytest.mark.parametrize("name", REFUSED)
def test_what_cannot_be_ends_it_with_status_2_and_a_line_that_says_why(name, way, start, tmp_path):
    value, says = REFUSED[name]
    (tmp_path / "params.yaml").write_text(f"/**:\n  ros__parameters:\n    {name}: {value}\n")
    arguments = ["--params-file", str(tmp_path / "params.yaml")] if way == "file" else ["-p", f"{name}:={value}"]
    node = start(fixed_frame=None, points=None, arguments=arguments)
    assert node.wait() == 2
    assert [line for line in node.lines if all(part in line for part in says)], "\n".join(node.lines)
    assert not any("ready:" in line for line in node.lines)
