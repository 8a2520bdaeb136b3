"""Makes a stereo camera's stream and calibration of a recording of EuRoC layout:  side_by_side.py RECORDING VIDEO YAML"""

import sys
from pathlib import Path

import cv2  # type: ignore[import]
import numpy as np

import twofold

recording, video, calibration = sys.argv[1:]
source = twofold.Source(f"euroc:{recording}")
rig = source.rig
writer = cv2.VideoWriter(video, cv2.VideoWriter_fourcc(*"MJPG"), 30, (2 * rig.width, rig.height))
for frame in source:
    assert frame.right is not None
    writer.write(cv2.cvtColor(np.hstack([frame.left, frame.right]), cv2.COLOR_GRAY2BGR))
writer.release()
Path(calibration).write_text(
    f"sensor: stereo\nbaseline: {rig.baseline}\ncameras:\n  - size: [{rig.width}, {rig.height}]\n"
    f"    intrinsics: [{rig.fx}, {rig.fy}, {rig.cx}, {rig.cy}]\n"
)
