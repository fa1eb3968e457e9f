from pathlib import Path
from xml.etree import ElementTree

from setuptools import find_packages, setup

package = ElementTree.parse(Path(__file__).with_name("package.xml")).getroot()
name = package.findtext("name")

# For wheels: what package.xml and requirements.txt say, by its name in pip. ROS is an extra:
# who has an ordinary ROS 2 needs no second one, others take pip install 'NAME[ros]'.
PIP_NAMES = {"yaml": "pyyaml", "pil": "pillow", "pygame": "pygame-ce"}
RMW = "rmw_fastrtps_cpp"  # without a middleware rclpy does not import
NO_WHEEL = {"launch", "launch_ros"}
keys = [each.text for each in package.findall("exec_depend")]
libraries = [key.removeprefix("python3-") for key in keys if key.startswith("python3-")]
ours = [key for key in keys if key.startswith("keepaway_")]
ros = sorted({*keys} - {*ours} - NO_WHEEL - {f"python3-{library}" for library in libraries})
lines = Path(__file__).with_name("requirements.txt").read_text().splitlines()

setup(
    name=name,
    version=package.findtext("version"),
    description=package.findtext("description"),
    license=package.findtext("license"),
    packages=find_packages(include=[name, f"{name}.*"]),
    package_data={name: ["**/*.json", "**/*.toml"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{name}"]),
        (f"share/{name}", ["package.xml", "LICENSE", "requirements.txt"]),
    ],
    python_requires=">=3.11",
    install_requires=[
        *ours,
        *(PIP_NAMES.get(library, library) for library in libraries),
        *(line for line in lines if line and not line.startswith("#")),
    ],
    extras_require={"ros": ["ros-jazzy-" + key.replace("_", "-") for key in [*ros, RMW]]},
    entry_points={
        "console_scripts": [
            "keeper = keepaway_agent.nodes.keeper:main",
            "taker = keepaway_agent.nodes.taker:main",
        ],
    },
    zip_safe=False,
)
