"""C++ against the headers that ROS generates of the messages."""

import os
import pathlib
import shutil
import subprocess

EXAMPLES = pathlib.Path(__file__).resolve().parents[2] / "examples"


def compile(source, *options, includes=(), examples=EXAMPLES):
    generated = [package for prefix in os.environ["AMENT_PREFIX_PATH"].split(":")
                 for package in sorted(pathlib.Path(prefix, "include").iterdir()) if package.is_dir()]
    compiler = shutil.which(os.environ.get("CXX", "c++"))
    assert compiler, "no C++ compiler (the ROS environment needs one too)"
    folders = [f"-I{folder}" for folder in (*generated, examples, *includes)]
    subprocess.run([compiler, "-std=c++17", "-Wall", "-Wextra", "-Werror", *folders, str(source), *options], check=True)


def run(source, folder, includes=()):
    """Compiles a program into a folder and runs it; it ends with another status than 0 where something is not so."""
    program = folder / source.stem
    compile(source, "-o", str(program), includes=includes)
    subprocess.run([str(program)], check=True)
