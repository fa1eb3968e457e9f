from pathlib import Path
from xml.etree import ElementTree

from setuptools import find_packages, setup

package = ElementTree.parse(Path(__file__).with_name("package.xml")).getroot()
name = package.findtext("name")

setup(
    name=name,
    version=package.findtext("version"),
    description=package.findtext("description"),
    license=package.findtext("license"),
    packages=find_packages(include=[name, f"{name}.*"]),
    package_data={name: ["**/*.json", "**/*.toml", "view/web/*"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{name}"]),
        (f"share/{name}", ["package.xml", "LICENSE", "requirements.txt", "fastdds.xml"]),
        (f"share/{name}/foxglove", ["foxglove/keepaway.json"]),
        (f"share/{name}/rviz", ["rviz/keepaway.rviz"]),
    ],
    entry_points={
        "console_scripts": [
            "simulator = keepaway_sim.nodes.simulator:main",
            "recorder = keepaway_sim.nodes.recorder:main",
            "replayer = keepaway_sim.nodes.replayer:main",
        ],
    },
    zip_safe=False,
)
