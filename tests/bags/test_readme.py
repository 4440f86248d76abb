"""The commands of README's section "Replay a bag", word for word."""

import os
import re
import shlex
import subprocess

import bags
import replay

HEADING = "## Replay a bag"
WRITES = {"--out", "--voxels", "--clusters", "--ply", "--summary", "--report", "--dst"}


def commands():
    """The first ```bash block below the heading."""
    _, found, rest = (bags.REPOSITORY / "README.md").read_text().partition(f"\n{HEADING}\n")
    assert found, f"README has no heading `{HEADING}`"
    section = re.split(r"^## ", rest, maxsplit=1, flags=re.MULTILINE)[0]
    block = re.search(r"^```bash\n(.*?)^```$", section, re.DOTALL | re.MULTILINE)
    assert block, f"no ```bash block below `{HEADING}`"
    return block.group(1)


def test_the_commands_of_the_readme_work(recordings, tmp_path):
    script = commands()
    words = shlex.split(script.replace("\\\n", " "), comments=True)
    assert "rosbags-convert" in words and "cfodi" in words
    bag = next(word for word in words if word.endswith(".bag"))
    bags.record(tmp_path / bag, "tum_fr3_cabinet58", "--decimate", "2")
    (tmp_path / "bin").mkdir()
    (tmp_path / "bin" / "cfodi").symlink_to(os.path.abspath(replay.BINARY))
    done = subprocess.run(["bash", "-euo", "pipefail", "-c", script], cwd=tmp_path, stdin=subprocess.DEVNULL, text=True,
                          env=os.environ | {"PATH": f"{tmp_path / 'bin'}:{os.environ['PATH']}"}, timeout=120,
                          capture_output=True)
    assert done.returncode == 0, f"{script}\n{done.stdout}{done.stderr}"
    written = [after for word, after in zip(words, words[1:]) if word in WRITES]
    assert len(written) >= 2, "a conversion and an output at least"
    for name in written:
        path = tmp_path / name
        assert path.is_dir() and any(path.iterdir()) or path.stat().st_size > 100, name
