# SPDX-License-Identifier: Apache-2.0

from setuptools import find_packages, setup

package_name = "leg_statics"

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
    description="What a leg can carry, better dimensions of it, and the nodes that serve both.",
    license="Apache-2.0",
    extras_require={"test": ["pytest"], "view": ["viser"]},
    entry_points={
        "console_scripts": [
            "designs_node = leg_statics.nodes.entry_points:designs_node",
            "gait_node = leg_statics.nodes.entry_points:gait_node",
            "judge_bag = leg_statics.recordings.judge_bag:main",
            "maps_node = leg_statics.nodes.entry_points:maps_node",
            "plot_index_map = leg_statics.commands.plot_index_map:main",
            "search_geometry = leg_statics.commands.search_geometry:main",
            "synthesize_six_bar = leg_statics.commands.synthesize_six_bar:main",
            "terrain_node = leg_statics.nodes.entry_points:terrain_node",
            "statics_node = leg_statics.nodes.entry_points:statics_node",
            "viewer = leg_statics.commands.viewer:main",
            "viewer_node = leg_statics.nodes.entry_points:viewer_node",
        ],
    },
)
