"""Path of a stereo camera, drawn while it moves:  webcam.py DEVICE CALIBRATION
DEVICE: number or file that OpenCV opens, both images side by side; CALIBRATION: what `twofold calibrate` wrote."""
import sys, threading, time

import cv2, twofold
import matplotlib.pyplot as plt

camera = cv2.VideoCapture(int(sys.argv[1]) if sys.argv[1].isdigit() else sys.argv[1])
rectifier = twofold.FrameRectifier(sys.argv[2])
slam = twofold.Slam(rectifier.rig, live=True)
problems = [] if camera.isOpened() else [f"{sys.argv[1]}: no camera or video that OpenCV can open"]

def push_frames():
    try:
        while (got := camera.read())[0]:  # until the end of a file, or the camera is pulled out
            left, right = got[1].reshape(len(got[1]), 2, -1, 3).swapaxes(0, 1)
            pushed = slam.push(rectifier.rectify(twofold.Frame(time.monotonic_ns(), left, right)))
            assert pushed.status != twofold.PushStatus.REFUSED, pushed.reason
    except Exception as error:  # images of another size, for one
        problems.append(f"{type(error).__name__}: {error}")
    slam.finish()  # whatever happened: this is where the poses end

threading.Thread(target=push_frames, daemon=True).start()  # drawing takes longer than a frame
path = []
for pose in (pose for pose in slam.poses() if pose.tracked):
    path.append(pose.T_world_camera.t[[0, 2]])
    if pose.frame % 10 == 0:
        plt.cla(), plt.plot(*zip(*path)), plt.axis("equal"), plt.pause(0.001)
sys.exit("; ".join(problems) or (None if path else "no frame was tracked") or print(f"{len(path)} poses"))
