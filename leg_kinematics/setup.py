# SPDX-License-Identifier: Apache-2.0

from setuptools import find_packages, setup

package_name = "leg_kinematics"

setup(
    name=package_name,
    version="0.1.0",
    packages=find_packages(exclude=["test"]),
    data_files=[
        ("share/ament_index/resource_index/packages", ["resource/" + package_name]),
        ("share/" + package_name, ["package.xml"]),
    ],
    install_requires=["setuptools"],
    zip_safe=True,
    maintainer="Leg Capacity Developers",
    maintainer_email="maintainers@example.org",
    description="Kinematics of legs with closed chains, and the node that serves them.",
    license="Apache-2.0",
    extras_require={"test": ["pytest"]},
    entry_points={
        "console_scripts": [
            "describe_robot = leg_kinematics.describe_robot:main",
            "export_robot = leg_kinematics.export_robot:main",
            "kinematics_node = leg_kinematics.nodes.entry_points:kinematics_node",
        ],
    },
)
