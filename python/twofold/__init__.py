"""Real-time visual SLAM: where the camera is, and what the place looks like.

    for pose in twofold.run("euroc:recordings/room"):
        if pose.tracked:
            print(pose.t_ns, pose.T_world_camera.t)

Everywhere: metres, radians, nanoseconds; T_a_b takes points of frame b to frame a; camera axes x right, y down, z
forward; quaternions x y z w.
"""

from ._cpu import check as _check_processor

_check_processor()  # before the library is loaded

from ._core import (  # noqa: E402
    AlignBy,
    BoardCalibration,
    BoardCalibrator,
    CalibratedCamera,
    CameraInfo,
    CameraRig,
    DistanceField,
    Frame,
    FrameRectifier,
    InitialPose,
    LateFrames,
    Map,
    MapEvent,
    MapEventKind,
    MapSurface,
    Pose,
    PoseEstimate,
    PushResult,
    PushStatus,
    Readout,
    RunMode,
    Sensor,
    SlamStep,
    Source,
    SpaceState,
    StageTime,
    Summary,
    SurfaceMesh,
    SurfaceChanges,
    SurfaceModel,
    SurfacePiece,
    SurfaceSnapshot,
    SurfaceUpdate,
    TrackingState,
    Trajectory,
    TrajectoryError,
    __version__,
    compare,
    load_trajectory,
)
from ._run import Run, run
from ._slam import Slam

__all__ = [
    "AlignBy",
    "BoardCalibration",
    "BoardCalibrator",
    "CalibratedCamera",
    "CameraInfo",
    "CameraRig",
    "DistanceField",
    "Frame",
    "FrameRectifier",
    "InitialPose",
    "LateFrames",
    "Map",
    "MapEvent",
    "MapEventKind",
    "MapSurface",
    "Pose",
    "PoseEstimate",
    "PushResult",
    "PushStatus",
    "Readout",
    "Run",
    "RunMode",
    "Sensor",
    "Slam",
    "SlamStep",
    "Source",
    "SpaceState",
    "StageTime",
    "Summary",
    "SurfaceMesh",
    "SurfaceChanges",
    "SurfaceModel",
    "SurfacePiece",
    "SurfaceSnapshot",
    "SurfaceUpdate",
    "TrackingState",
    "Trajectory",
    "TrajectoryError",
    "__version__",
    "compare",
    "load_trajectory",
    "run",
]
