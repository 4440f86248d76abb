"""What a launch file would start. launch and launch_ros are not to be had from PyPI, so this stands in for the parts of them
that the launch files of this project use, with the arguments that those take and no others; it records the processes and
starts none. Command lines, and the files that parameters are passed in, are as launch_ros makes them (humble to rolling)."""

import dataclasses
import importlib.util
import pathlib
import sys
import types

import yaml

SCRIPTS = pathlib.Path(__file__).resolve().parents[2] / "launch_scripts"


@dataclasses.dataclass
class Process:
    """`command` after the executable; `package` and `name` are None of what is no node."""
    executable: str
    command: list
    package: str | None = None
    name: str | None = None


@dataclasses.dataclass
class Context:
    folder: pathlib.Path  # of params files
    values: dict
    declared: dict = dataclasses.field(default_factory=dict)
    processes: list = dataclasses.field(default_factory=list)


def text(value, context):
    return value.perform(context) if isinstance(value, LaunchConfiguration) else value


class LaunchConfiguration:
    def __init__(self, variable_name):
        self.name = variable_name

    def perform(self, context):
        return context.values[self.name]


class IfCondition:
    def __init__(self, predicate_expression):
        self.predicate = predicate_expression

    def holds(self, context):
        return {"true": True, "1": True, "false": False, "0": False}[text(self.predicate, context).lower()]


class ParameterValue:
    def __init__(self, value, *, value_type):
        self.value, self.value_type = value, value_type

    def evaluate(self, context):
        return self.value_type(text(self.value, context))


class LaunchDescription:
    def __init__(self, entities):
        self.entities = entities

    def visit(self, context):
        for entity in self.entities:
            entity.visit(context)


class DeclareLaunchArgument:
    def __init__(self, name, *, default_value=None, description, choices=None):
        self.name, self.default, self.description, self.choices = name, default_value, description, choices

    def visit(self, context):
        if self.name not in context.values:
            assert self.default is not None, f"the launch argument {self.name} has no value"
            context.values[self.name] = self.default
        value = context.values[self.name]
        assert isinstance(value, str), f"the launch argument {self.name} is no text: {value!r}"
        assert self.choices is None or value in self.choices, f"{self.name} is {value!r}, not one of {self.choices}"
        context.declared.setdefault(self.name, self.description)


class OpaqueFunction:
    def __init__(self, *, function):
        self.function = function

    def visit(self, context):
        LaunchDescription(self.function(context)).visit(context)


class PythonLaunchDescriptionSource:
    def __init__(self, launch_file_path):
        self.path = pathlib.Path(launch_file_path)


class IncludeLaunchDescription:
    """Without arguments of its own: the included file has the same values, and may add some."""

    def __init__(self, launch_description_source):
        self.source = launch_description_source

    def visit(self, context):
        load(self.source.path).visit(context)


class ExecuteProcess:
    def __init__(self, *, cmd, output):
        self.cmd = cmd

    def visit(self, context):
        executable, *command = (text(word, context) for word in self.cmd)
        context.processes.append(Process(executable, command))


class Node:
    def __init__(self, *, package, executable, name=None, namespace=None, parameters=(), remappings=(), arguments=(),
                 ros_arguments=(), output="log", condition=None, sigterm_timeout="5"):
        self.package, self.executable, self.name, self.namespace = package, executable, name, namespace
        self.parameters, self.remappings, self.condition = parameters, remappings, condition
        self.arguments, self.ros_arguments = arguments, ros_arguments

    def visit(self, context):
        if self.condition is not None and not self.condition.holds(context):
            return
        words = [*self.arguments, *(["--ros-args", *self.ros_arguments] if self.ros_arguments else []), "--ros-args"]
        command = [text(word, context) for word in words]
        name = text(self.name, context)
        if name is not None:
            command += ["-r", f"__node:={name}"]
        namespace = None
        if self.namespace is not None:
            namespace = "/" + text(self.namespace, context).lstrip("/")
            command += ["-r", f"__ns:={namespace}"]
        full_name = f"{namespace.rstrip('/')}/{name}" if name and namespace else "/**"
        for number, parameters in enumerate(self.parameters):
            command += ["--params-file", self.params_file(parameters, full_name, f"{len(context.processes)}_{number}", context)]
        for source, target in self.remappings:
            command += ["-r", f"{text(source, context)}:={text(target, context)}"]
        assert all(isinstance(word, str) for word in command), command
        context.processes.append(Process(self.executable, command, self.package, name))

    @staticmethod
    def params_file(parameters, full_name, number, context):
        if not isinstance(parameters, dict):
            return str(text(parameters, context))
        values = {name: value.evaluate(context) if isinstance(value, ParameterValue) else value
                  for name, value in parameters.items()}
        file = context.folder / f"launch_params_{number}"
        file.write_text(yaml.dump({full_name: {"ros__parameters": values}}, default_flow_style=False))
        return str(file)


MODULES = {
    "launch": [LaunchDescription],
    "launch.actions": [DeclareLaunchArgument, ExecuteProcess, IncludeLaunchDescription, OpaqueFunction],
    "launch.conditions": [IfCondition],
    "launch.launch_description_sources": [PythonLaunchDescriptionSource],
    "launch.substitutions": [LaunchConfiguration],
    "launch_ros": [],
    "launch_ros.actions": [Node],
    "launch_ros.parameter_descriptions": [ParameterValue],
}


def load(path):
    """The description in a launch file, loaded as launch does, with the stand-ins for what it imports."""
    for name, things in MODULES.items():
        sys.modules[name] = module = types.ModuleType(name)
        vars(module).update({thing.__name__: thing for thing in things})
    try:
        spec = importlib.util.spec_from_file_location("python_launch_file", path)
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
    finally:
        for name in MODULES:
            del sys.modules[name]
    return module.generate_launch_description()


def launched(file, folder, **values):
    """What `ros2 launch cfodi FILE name:=value ...` would do; parameters are written into `folder`."""
    context = Context(folder, values)
    load(SCRIPTS / file).visit(context)
    unknown = values.keys() - context.declared.keys()
    assert not unknown, f"{file} has no arguments {unknown}"
    return context
