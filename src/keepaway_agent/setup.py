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
    package_data={name: ["**/*.json", "**/*.toml"]},
    data_files=[
        ("share/ament_index/resource_index/packages", [f"resource/{name}"]),
        (f"share/{name}", ["package.xml", "LICENSE", "requirements.txt"]),
    ],
    entry_points={
        "console_scripts": [
            "keeper = keepaway_agent.nodes.keeper:main",
            "taker = keepaway_agent.nodes.taker:main",
        ],
    },
    zip_safe=False,
)
