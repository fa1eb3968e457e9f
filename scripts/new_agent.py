"""Make an agent of your own to start from: a script, or with --package a ROS 2 package.

    .venv/bin/python scripts/new_agent.py quick_keeper
    .venv/bin/python scripts/match.py --episodes 5 --agent keeper_1=quick_keeper.py

It begins as the smallest complete agent of the contract page and plays as it is, as keeper and as
taker. Change its `choose`.
"""

import argparse
import sys
from pathlib import Path

TEMPLATE = (
    Path(__file__).resolve().parents[1] / "src/keepaway_agent/examples/smallest_agent.py"
).read_text(encoding="utf-8")
PACKAGE_FILES = {
    "package.xml": """\
<?xml version="1.0"?>
<package format="3">
  <name>{name}</name>
  <version>0.1.0</version>
  <description>An agent for keepaway.</description>
  <maintainer email="you@example.com">you</maintainer>
  <license>Apache-2.0</license>
  <exec_depend>rclpy</exec_depend>
  <exec_depend>keepaway_msgs</exec_depend>
  <export>
    <build_type>ament_python</build_type>
  </export>
</package>
""",
    "setup.cfg": """\
[develop]
script_dir=$base/lib/{name}
[install]
install_scripts=$base/lib/{name}
""",
    "setup.py": """\
from setuptools import setup

setup(
    name="{name}",
    version="0.1.0",
    packages=["{name}"],
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/{name}"]),
        ("share/{name}", ["package.xml"]),
    ],
    entry_points={{"console_scripts": ["agent = {name}.agent:main"]}},
)
""",
    "resource/{name}": "",
    "{name}/__init__.py": "",
}


def main() -> int:
    """Write it, and say how to start it."""
    args = parse()
    made = {args.directory / path: text for path, text in files(args.name, args.package).items()}
    for path, text in made.items():
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            with open(path, "x", encoding="utf-8") as file:
                file.write(text)
        except OSError as error:
            print(f"new_agent: {path}: {error.strerror}", file=sys.stderr)
            return 1
    script = list(made)[-1]
    print(f"made {script}; to watch it play, and to test it:")
    print(f"  .venv/bin/python scripts/match.py --episodes 5 --agent keeper_1={script}")
    print(f"  .venv/bin/python scripts/check_agent.py -- {script}")
    return 0


def files(name: str, is_package: bool) -> dict[Path, str]:
    """Texts of the files to write; the agent's script comes last."""
    class_name = "".join(word.capitalize() for word in name.split("_"))
    script = TEMPLATE.replace("SmallestAgent", class_name)
    if not is_package:
        return {Path(f"{name}.py"): script}
    package = {
        Path(name, path.format(name=name)): text.format(name=name)
        for path, text in PACKAGE_FILES.items()
    }
    return {**package, Path(name, name, "agent.py"): script}


def parse() -> argparse.Namespace:
    """The command line."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("name", help="of the script or package, like quick_keeper")
    parser.add_argument("--package", action="store_true", help="make a ROS 2 package (colcon, pip)")
    parser.add_argument("--directory", type=Path, default=Path(), help="to make it in")
    args = parser.parse_args()
    if not args.name.isidentifier() or args.name != args.name.lower():
        parser.error(f"{args.name!r}: give lower-case letters, digits and underscores")
    return args


if __name__ == "__main__":
    sys.exit(main())
