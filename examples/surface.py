"""The surface of a recording's keyframes: is the way ahead free, and a mesh of what was seen.

    python3 surface.py [SOURCE [MESH.glb]]

The source has depth: RGB-D, or stereo.
"""

from __future__ import annotations

import sys

import numpy as np

import twofold


def main(name: str = "synthetic:desk?sensor=rgbd&frames=60&width=320&height=240", mesh: str = "") -> None:
    source = twofold.Source(name)
    last = None
    with twofold.Slam(source.rig, mode=twofold.RunMode.DETERMINISTIC) as slam:
        surface = twofold.MapSurface(slam.map(), voxel_size=0.02)
        for frame in source:
            slam.push(frame)
            pose = slam.latest()
            if pose is None or not pose.tracked:
                continue
            last = pose
            if pose.keyframe:
                surface.add(frame, pose.frame)
                surface.update(slam.map())
    now = surface.snapshot()  # for any thread, however long; the surface goes on without it
    here = (last and now.camera_pose(last)) or twofold.Pose()  # in the snapshot's world
    metres = np.arange(0, 3, 0.01)
    ahead = now.at(np.array([here @ np.array([0, 0, z]) for z in metres]))
    free = metres[ahead["state"] == twofold.SpaceState.FREE.value]
    print(f"free ahead from {free.min():.2f} to {free.max():.2f} m" if len(free) else "nothing is known ahead")
    field = now.distances(here.t - 0.5, here.t + 0.5, resolution=0.1, max_distance=1)
    # Negative in obstacles, and in what nobody has looked at.
    print(f"within half a metre there are {max(field.distances.max(), 0):.2f} m of free space around some place")
    if mesh:
        now.mesh().save(mesh)
        print(f"{len(now.mesh().triangles)} triangles written to {mesh}")


if __name__ == "__main__":
    main(*sys.argv[1:3])
