"""`cfodi replay` as a process, and its outputs as a reader sees them."""

import csv
import json
import os
import subprocess
from collections import namedtuple

import numpy as np
from bags import REPOSITORY

BINARY = os.environ.get("CFODI_BIN") or REPOSITORY / "target" / "release" / "cfodi"
OUTPUTS = {"summary": "S.json", "voxels": "V.csv", "clusters": "C.json", "ply": "P.ply", "out": "RESULT.mcap"}
V_HEADER = "ix,iy,iz,count,cx,cy,cz,nx,ny,nz,cluster_id"
PLY_TYPES = {"float": "<f4", "double": "<f8", "uchar": "u1", "uint8": "u1", "uint": "<u4", "uint32": "<u4"}

Voxel = namedtuple("Voxel", "count centre normal cluster")


def cfodi(*arguments, cwd=None):
    """The finished process: `.returncode`, `.stdout`, `.stderr`. Nothing of the caller's ROS reaches it."""
    variables = {k: v for k, v in os.environ.items() if not k.startswith(("ROS_", "RMW_", "RUST_LOG"))}
    return subprocess.run([str(BINARY), *map(str, arguments)], cwd=cwd, env=variables, stdin=subprocess.DEVNULL,
                          capture_output=True, text=True, errors="replace", timeout=120)


class Replay:
    """One run of `cfodi replay BAG` that writes its outputs to `folder`."""

    def __init__(self, bag, folder, *options, parameters=None, topics=(), outputs=tuple(OUTPUTS), status=0):
        folder.mkdir(parents=True, exist_ok=True)
        self.folder = folder
        command = ["replay", bag]
        for topic in topics:
            command += ["--topic", topic]
        for name in outputs:
            command += [f"--{name}", folder / OUTPUTS[name]]
        command += options
        if parameters:
            command += ["--ros-args"]
            for name, value in parameters.items():
                command += ["-p", f"{name}:={value}"]
        self.command = " ".join(map(str, command))
        done = cfodi(*command)
        self.status, self.stdout, self.stderr = done.returncode, done.stdout, done.stderr
        assert self.status == status, f"cfodi {self.command}: exit status {self.status}, not {status}:\n{self.stderr}"

    def path(self, output):
        return self.folder / OUTPUTS[output]

    def bytes(self, output):
        return self.path(output).read_bytes()

    def summary(self):
        return json.loads(self.path("summary").read_text())

    def clusters(self):
        """C.json as a list, whether it stands alone or under a key."""
        read = json.loads(self.path("clusters").read_text())
        return read["clusters"] if isinstance(read, dict) else read

    def voxels(self):
        """V.csv as {(ix, iy, iz): Voxel}, in the order of its lines."""
        lines = self.path("voxels").read_text().splitlines()
        assert lines[0] == V_HEADER
        rows = list(csv.reader(lines[1:]))
        assert all(len(row) == 11 for row in rows)
        return {tuple(map(int, row[:3])): Voxel(int(row[3]), tuple(map(float, row[4:7])), tuple(map(float, row[7:10])),
                                                int(row[10])) for row in rows}

    def ply(self):
        """The vertices of P.ply as a structured array."""
        head, _, body = self.bytes("ply").partition(b"end_header\n")
        lines = head.decode("ascii").splitlines()
        assert lines[0] == "ply"
        (count,) = (int(line.split()[2]) for line in lines if line.startswith("element vertex "))
        kinds = [(line.split()[2], PLY_TYPES[line.split()[1]]) for line in lines if line.startswith("property ")]
        if "format ascii 1.0" in lines:
            return np.array([tuple(map(float, line.split())) for line in body.decode("ascii").splitlines()],
                            dtype=kinds)
        assert "format binary_little_endian 1.0" in lines
        vertices = np.frombuffer(body, kinds)
        assert len(vertices) == count
        return vertices


def same_map(one, other):
    """Two runs gave the same voxels, clusters and points, byte for byte."""
    for output in ("voxels", "clusters", "ply"):
        assert one.bytes(output) == other.bytes(output), f"{OUTPUTS[output]} differs: {one.command} | {other.command}"
