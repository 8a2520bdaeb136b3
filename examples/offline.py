"""A recording, tracked the same way every time, and how far from the truth it came out:
    offline.py [SOURCE [TRAJECTORY]]"""

import sys

import twofold

source = twofold.Source(sys.argv[1] if len(sys.argv) > 1 else "synthetic:courtyard?frames=90")
with twofold.run(source, mode=twofold.RunMode.DETERMINISTIC) as run:
    for update in run.updates():
        if isinstance(update, twofold.MapEvent):
            print(f"frame {update.frame}: {update.kind.name.lower()}, the camera's place moved by {update.moved:.3f} m")
        elif not update.tracked:
            print(f"frame {update.frame}: {update.reason}")

summary = run.finish()
points = run.slam.map().points()
print(f"{summary.tracked} of {summary.frames} frames tracked, {len(points)} points")
if len(sys.argv) > 2:
    summary.trajectory.save(sys.argv[2])
if len(source.ground_truth) > 0:
    print(twofold.compare(summary.trajectory, source.ground_truth))
