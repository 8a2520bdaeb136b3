"""Path of a stereo camera, drawn while it moves:  webcam.py DEVICE CALIBRATION
DEVICE: number or file that OpenCV opens, both images side by side; CALIBRATION: what `twofold calibrate` wrote."""
import sys
import threading
import time

import cv2
import matplotlib.pyplot as plt
import twofold

camera = cv2.VideoCapture(int(sys.argv[1]) if sys.argv[1].isdigit() else sys.argv[1])
rectifier = twofold.FrameRectifier(sys.argv[2])
slam = twofold.Slam(rectifier.rig, live=True)

def push_frames():
    while (got := camera.read())[0]:
        left, right = got[1].reshape(len(got[1]), 2, -1, 3).swapaxes(0, 1)
        slam.push(rectifier.rectify(twofold.Frame(time.monotonic_ns(), left, right)))
    slam.finish()

threading.Thread(target=push_frames, daemon=True).start()  # drawing takes longer than a frame
path = []
for pose in slam.poses():
    if pose.tracked:
        path.append(pose.T_world_camera.t[[0, 2]])
    if pose.tracked and pose.frame % 10 == 0:
        plt.cla(), plt.plot(*zip(*path)), plt.axis("equal"), plt.pause(0.001)
print(f"{len(path)} poses")
