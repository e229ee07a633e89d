# SPDX-License-Identifier: Apache-2.0
"""What the package exports is there when it is asked for, and costs nothing before."""

import subprocess
import sys

import leg_statics
from leg_statics import exports, footholds


def test_every_export_is_there():
    assert dir(leg_statics) == sorted(exports.__all__)
    for name in leg_statics.__all__:
        assert getattr(leg_statics, name) is getattr(exports, name)
    assert leg_statics.evaluate_footholds is footholds.evaluate_footholds


def test_exports_are_loaded_when_they_are_asked_for_without_ros_or_pictures():
    code = (
        "import sys, leg_statics; early = 'numpy' in sys.modules; leg_statics.plane_map; "
        "late = {'rclpy', 'matplotlib', 'leg_msgs'} & {n.split('.')[0] for n in sys.modules}; "
        "sys.exit(early or bool(late))"
    )
    assert subprocess.run([sys.executable, "-c", code], check=False).returncode == 0
