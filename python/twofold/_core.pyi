from collections.abc import Iterator
from os import PathLike
from typing import ClassVar, overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

__version__: str

class _Enum:
    def __init__(self, value: int) -> None: ...
    @property
    def name(self) -> str: ...
    @property
    def value(self) -> int: ...
    def __eq__(self, other: object) -> bool: ...
    def __hash__(self) -> int: ...

class Pose:
    """Rigid motion T_a_b: takes points of frame b to frame a, p_a = T_a_b @ p_b."""
    @overload
    def __init__(self) -> None:
        """The identity."""
    @overload
    def __init__(self, t: ArrayLike, q: ArrayLike) -> None:
        """From t (3,) [m] and the unit quaternion q (4,), x y z w, which is normalised when within 0.01 of length 1.
        Raises ValueError.
        """
    @property
    def t(self) -> NDArray[np.float64]:
        """Translation (3,) [m], read-only."""
    @property
    def q(self) -> NDArray[np.float64]:
        """Unit quaternion (4,), x y z w, read-only."""
    @staticmethod
    def from_matrix(T: ArrayLike) -> Pose:
        """From the 4x4 matrix T_a_b [R t; 0 0 0 1]; R is made a rotation exactly when it is one within 0.001. Raises
        ValueError.
        """
    def matrix(self) -> NDArray[np.float64]:
        """The 4x4 matrix, a new array."""
    def inverse(self) -> Pose:
        """T_b_a."""
    @overload
    def __matmul__(self, other: Pose) -> Pose:
        """T_a_c = T_a_b @ T_b_c; of points (3,) or (N, 3) [m], a new array of the same shape."""
    @overload
    def __matmul__(self, other: ArrayLike) -> NDArray[np.float64]: ...
    def __eq__(self, other: object) -> bool: ...

class Sensor(_Enum):
    """What the frames are of."""
    STEREO: ClassVar[Sensor]
    """a left and a right image"""
    RGBD: ClassVar[Sensor]
    """an image and its depth"""
    MONO: ClassVar[Sensor]
    """one camera, right up to its scale"""

class CameraRig:
    """A rectified sensor: pinhole cameras without distortion; of a stereo pair the right one is shifted by `baseline`
    along x.
    """
    sensor: Sensor
    """Sensor: STEREO, RGBD or MONO."""
    width: int
    """[px]."""
    height: int
    """[px]."""
    fx: float
    """Focal length along x [px]."""
    fy: float
    """Focal length along y [px]."""
    cx: float
    """Principal point [px]."""
    cy: float
    """Principal point [px]."""
    baseline: float
    """[m]; RGB-D: of the virtual right camera."""
    depth_unit: float
    """Metres per unit of the depth image."""
    depth_min: float
    """Nearer readings are holes [m]."""
    depth_max: float
    """Farther ones likewise [m]."""
    readout: float | None
    """Of a rolling shutter [s]; 0: none; None: to be found out."""
    def __init__(
        self,
        *,
        sensor: Sensor = ...,
        width: int,
        height: int,
        fx: float,
        fy: float,
        cx: float,
        cy: float,
        baseline: float = ...,
        depth_unit: float = ...,
        depth_min: float = ...,
        depth_max: float = ...,
        readout: float | None = ...,
    ) -> None:
        """Sizes, focal lengths and principal point in pixels; baseline in metres, of RGB-D that of the virtual right
        camera (0.08), of MONO none; depth_unit: metres per unit of the depth image; readings outside depth_min to
        depth_max [m] are holes; readout of a rolling shutter [s], 0 when all rows are exposed at once, None when it is
        to be found out.
        """

class TrackingState(_Enum):
    """What became of a frame."""
    TRACKED: ClassVar[TrackingState]
    """the pose is known"""
    LOST: ClassVar[TrackingState]
    """looked at, no trustworthy pose"""
    UNPLACED: ClassVar[TrackingState]
    """in a loaded map, no place of which was recognised yet"""

class PoseEstimate:
    """What is known of the camera at one frame."""
    @property
    def frame(self) -> int:
        """Counts pushed frames from 0, dropped ones included."""
    @property
    def t_ns(self) -> int:
        """The frame's own time [ns]."""
    @property
    def state(self) -> TrackingState:
        """TrackingState: tracked, lost or unplaced."""
    @property
    def tracked(self) -> bool:
        """Whether the pose is known; without it, poses, ids, covariance and velocity mean nothing."""
    @property
    def keyframe(self) -> bool:
        """Whether it was proposed as a keyframe of the map."""
    @property
    def effort(self) -> int:
        """Effort level; 0: nothing was left out."""
    @property
    def reason(self) -> str:
        """Why it is lost, in words."""
    @property
    def points(self) -> int:
        """Measurements that the pose rests on."""
    @property
    def tracked_share(self) -> float:
        """Those over the points looked for, 0 to 1."""
    @property
    def T_world_camera(self) -> Pose:
        """Pose of the left camera [m] in the world of `map_part`."""
    @property
    def map_part(self) -> int | None:
        """Id of the map part, whose world T_world_camera is in: that of its first keyframe, which may be gone. None:
        not tracked.
        """
    @property
    def reference_keyframe(self) -> int | None:
        """Id of the keyframe that the pose is known against; None: not tracked."""
    @property
    def T_reference_camera(self) -> Pose:
        """Pose relative to reference_keyframe [m]: this survives corrections of the map."""
    @property
    def T_odom_camera(self) -> Pose:
        """Odometry: a pose [m] in a frame that no correction of the map moves. Drift accumulates; map to odometry is
        T_world_camera * T_odom_camera.inverse().
        """
    @property
    def covariance(self) -> NDArray[np.float64]:
        """(6, 6), read-only: of (translation [m], rotation [rad]) in the camera's axes, relative to the reference
        keyframe. All zero for the frame that starts a map part, and defines its world; all NaN when it is not known.
        """
    @property
    def covariance_known(self) -> bool:
        """False when the measurements leave a direction open, and for frames that are not tracked."""
    @property
    def velocity(self) -> NDArray[np.float64]:
        """(6,), read-only: linear [m/s] and angular [rad/s], in the camera's axes."""
    @property
    def map_version(self) -> int:
        """Version of the map that it was tracked against."""
    @property
    def exposed_ns(self) -> int:
        """When the frame was exposed, on CLOCK_MONOTONIC [ns]; without `live` or `speed`, when the tracker took it."""
    @property
    def latency_ns(self) -> int:
        """From then to the moment the pose was known [ns]."""

class MapEventKind(_Enum):
    """Why the camera's pose jumped."""
    OPTIMISATION: ClassVar[MapEventKind]
    """a round of the double window"""
    LOOP_CLOSURE: ClassVar[MapEventKind]
    """a place was recognised"""
    POSE_GRAPH: ClassVar[MapEventKind]
    """the whole pose graph was optimised"""
    PARTS_JOINED: ClassVar[MapEventKind]
    """the camera's part took another one's world, or another moved into its"""
    RELOCALISATION: ClassVar[MapEventKind]
    """the lost camera found itself"""
    NEW_PART: ClassVar[MapEventKind]
    """the lost camera began another part"""

class MapEvent:
    """Why poses given out before are no longer what the map says."""
    @property
    def kind(self) -> MapEventKind:
        """MapEventKind."""
    @property
    def frame(self) -> int:
        """The first that saw it."""
    @property
    def t_ns(self) -> int:
        """That frame's time [ns]."""
    @property
    def map_version(self) -> int:
        """The corrected version of the map."""
    @property
    def keyframe(self) -> int | None:
        """Reference keyframe of that frame; None: it is lost."""
    @property
    def map_part_before(self) -> int | None:
        """Part the camera was in; None: it was in none yet."""
    @property
    def map_part(self) -> int | None:
        """Part it is in now."""
    @property
    def T_world_camera_before(self) -> Pose:
        """Pose of the last tracked frame as it was told [m], in the world of map_part_before."""
    @property
    def T_world_camera_after(self) -> Pose:
        """Where the corrected map has it [m]; after a relocalisation or in a new part, the frame that found itself."""
    @property
    def moved(self) -> float:
        """Distance between the two [m]; 0 across map parts, whose worlds share nothing."""
    @property
    def turned(self) -> float:
        """Angle between the two [rad]; likewise."""
    @property
    def loop_from(self) -> int | None:
        """Of a loop that was closed: the older keyframe. None: no loop, or not known."""
    @property
    def loop_to(self) -> int | None:
        """The keyframe that came back; likewise."""
    @property
    def keyframes_moved(self) -> int:
        """How many moved by a centimetre or 0.2 degrees, or joined another part."""
    @property
    def farthest_moved(self) -> float:
        """By a keyframe that kept its part [m]."""
    @property
    def most_turned(self) -> float:
        """Likewise [rad]."""

class Trajectory:
    """Where the camera was, in the order of time. Columns are read-only views."""
    def __init__(self, t_ns: ArrayLike, positions: ArrayLike, orientations: ArrayLike) -> None:
        """From t_ns (N,) [ns], which must grow, positions (N, 3) [m] and unit quaternions (N, 4), x y z w; copied.
        Quaternions within 0.01 of length 1 are normalised. Raises ValueError naming row and value.
        """
    @property
    def t_ns(self) -> NDArray[np.int64]:
        """(N,) int64 [ns]."""
    @property
    def positions(self) -> NDArray[np.float64]:
        """(N, 3) [m], in the world."""
    @property
    def orientations(self) -> NDArray[np.float64]:
        """(N, 4): unit quaternions x y z w of T_world_camera."""
    def __len__(self) -> int: ...
    def pose(self, index: int) -> Pose:
        """T_world_camera of one."""
    def save(self, file: str | PathLike[str]) -> None:
        """TUM form: lines "time[s] tx ty tz qx qy qz qw". Raises RuntimeError."""

def load_trajectory(file: str | PathLike[str]) -> Trajectory:
    """TUM, KITTI or EuRoC form, told by the first line. Raises RuntimeError naming file and line."""

class TrajectoryError:
    """How far an estimate is from the truth."""
    @property
    def pairs(self) -> int:
        """Poses that have a true one."""
    @property
    def path_length(self) -> float:
        """Of the truth over the pairs [m]."""
    @property
    def ate_rmse(self) -> float:
        """Absolute trajectory error [m]."""
    @property
    def ate_mean(self) -> float:
        """[m]."""
    @property
    def ate_median(self) -> float:
        """[m]."""
    @property
    def ate_max(self) -> float:
        """[m]."""
    @property
    def rotation_rmse(self) -> float:
        """[rad]."""
    @property
    def rpe_rmse(self) -> float:
        """Relative error over one second, translation [m]; nan: no two poses are one second apart."""
    @property
    def scale(self) -> float:
        """The estimate's lengths times this are the truth's."""

class AlignBy(_Enum):
    """What the estimate may be moved by before it is compared."""
    NOTHING: ClassVar[AlignBy]
    """it is compared as it is"""
    RIGID_MOTION: ClassVar[AlignBy]
    """rotation and translation"""
    SIMILARITY: ClassVar[AlignBy]
    """and scale, for one camera"""

def compare(
    estimate: Trajectory, truth: Trajectory, *, align: AlignBy = ..., max_time_difference: float = ...
) -> TrajectoryError:
    """The estimate is aligned with the truth first; max_time_difference [s]: between a pose and its true one. Raises
    ValueError when there is nothing to compare.
    """

class Frame:
    """The images of one instant.

    Grey images (uint8, height x width) and depth (uint16, likewise) are used where they are: do not write into them
    afterwards. Depth in metres (float32) is rounded to CameraRig.depth_unit in a copy. Colour (uint8, height x width x
    3) is turned to grey, a copy, when the frame is pushed. An array whose rows do not lie row after row, pixel beside
    pixel (a transposed or mirrored one), is copied here; `copied` names it.
    """
    def __init__(
        self,
        t_ns: int,
        left: NDArray[np.uint8],
        right: NDArray[np.uint8] | None = None,
        depth: NDArray[np.uint16] | NDArray[np.float32] | None = None,
        *,
        colours: str = "bgr",
    ) -> None:
        """t_ns [ns] must grow from frame to frame; colours: order in colour images, 'bgr' or 'rgb'."""
    @property
    def t_ns(self) -> int:
        """When it was taken [ns]."""
    @property
    def left(self) -> NDArray[np.uint8]:
        """A read-only view of the pixels: (height, width) uint8, or (height, width, 3)."""
    @property
    def right(self) -> NDArray[np.uint8] | None:
        """The same, or None."""
    @property
    def depth(self) -> NDArray[np.uint16] | NDArray[np.float32] | None:
        """(height, width) uint16 in units of CameraRig.depth_unit, or float32 [m], read-only; or None."""
    @property
    def copied(self) -> tuple[str, ...]:
        """Names of the images that were copied when the frame was made."""

class Source:
    """Frames of a recording, a video, a rendered scene or a camera, rectified.

    Named as on the command line: a path, or kitti:DIR, euroc:DIR, tum:DIR, 7scenes:DIR, replica:DIR, scannet:DIR,
    images:DIR, video:FILE, mcap:FILE, bag:FILE, v4l2:DEVICE, synthetic:SCENE, with ?key=value&key=value. Iterating
    gives Frames; the interpreter runs on meanwhile.
    """
    def __init__(self, name: str | PathLike[str], *, calibration: str | PathLike[str] | None = None, preload: bool = False, left_only: bool = False) -> None:
        """calibration: file instead of the recording's own; preload: decode everything now; left_only: the left camera
        alone, as Sensor.MONO. Raises RuntimeError.
        """
    @property
    def rig(self) -> CameraRig:
        """CameraRig of all frames: size [px], focal lengths [px], baseline [m]."""
    @property
    def T_rectified_raw(self) -> Pose:
        """Pose, a rotation alone, of the calibrated left camera in the one that poses are of, by the calibration this
        source uses; the identity where images come as they were: T_world_raw = pose.T_world_camera @
        source.T_rectified_raw.
        """
    @property
    def frame_count(self) -> int | None:
        """None where it is not known beforehand."""
    @property
    def is_live(self) -> bool:
        """Frames come when they are taken, not when asked for."""
    @property
    def ground_truth(self) -> Trajectory:
        """Trajectory of the rig's camera; empty when there is none."""
    def next(self) -> Frame | None:
        """The next frame, or None at the end. Any thread: those that ask at once take turns."""
    def in_colour(self, frame: Frame) -> Frame:
        """A frame that this source gave, with its left image in colour (blue, green, red) if the recording has it, else
        as it is: for SurfaceModel.add and MapSurface.add. Decoded when it is asked for. Raises RuntimeError when the
        input breaks.
        """
    def stop(self) -> None:
        """A camera ends; of recordings, no more frames are given. From any thread."""
    def __iter__(self) -> Iterator[Frame]: ...
    def __next__(self) -> Frame: ...
    def __enter__(self) -> Source: ...
    def __exit__(self, *args: object) -> None: ...

class CameraInfo:
    """A camera and its lens in numbers, named as in ROS' sensor_msgs/CameraInfo; with binning or a region of interest
    there, make size, K and P those of the images first.
    """
    def __init__(
        self,
        *,
        width: int,
        height: int,
        K: ArrayLike,
        D: ArrayLike = ...,
        distortion_model: str = ...,
        R: ArrayLike | None = None,
        P: ArrayLike | None = None,
    ) -> None:
        """width, height [px]: of the raw images; K (9,) or (3, 3) [px]; D: coefficients of 'plumb_bob' (k1 k2 p1 p2
        [k3]), 'rational_polynomial' (k1 k2 p1 p2 k3 k4 k5 k6) or 'equidistant' (k1 k2 k3 k4), zeros at the end may be
        left out; R (9,) or (3, 3), P (12,) or (3, 4): of a pair whose pose between is not given. Raises ValueError.
        """
    @property
    def width(self) -> int:
        """Of the raw images [px]."""
    @property
    def height(self) -> int:
        """Of the raw images [px]."""
    @property
    def distortion_model(self) -> str:
        """What D is of."""
    @property
    def D(self) -> NDArray[np.float64]:
        """(N,), read-only."""
    @property
    def K(self) -> NDArray[np.float64]:
        """(3, 3) [px], read-only."""
    @property
    def R(self) -> NDArray[np.float64]:
        """(3, 3): rotation from the raw to the rectified camera, read-only."""
    @property
    def P(self) -> NDArray[np.float64]:
        """(3, 4): of the rectified camera; P[0, 3] = -fx * baseline of the right one. Read-only."""

class FrameRectifier:
    """Makes rectified frames of those that a camera gives, by a calibration: a file, or numbers."""
    @overload
    def __init__(self, calibration: str | PathLike[str], width: int = 0, height: int = 0, left_only: bool = False) -> None:
        """calibration: a file, or a folder in EuRoC's layout, which has a file a camera; width, height [px]: of the raw
        images, for calibrations that do not state it; left_only: of such a folder, the left camera alone. Raises
        RuntimeError, also for one file of a pair's two.
        """
    @overload
    def __init__(self, calibration: BoardCalibration) -> None:
        """What a BoardCalibrator found. Raises ValueError, as do those that follow."""
    @overload
    def __init__(self, camera: CameraInfo, *, sensor: Sensor = ...) -> None:
        """One camera by its K and D. sensor: MONO, or RGBD with depth images that are the camera's, pixel by pixel."""
    @overload
    def __init__(self, left: CameraInfo, right: CameraInfo, *, T_right_left: Pose | None = None) -> None:
        """A stereo pair by K and D of both, and the left camera's pose in the right one; without it, by their R and P.
        """
    @property
    def rig(self) -> CameraRig:
        """What the rectified frames are of."""
    @property
    def T_rectified_raw(self) -> Pose:
        """Pose, a rotation alone, of the calibrated left camera in the one that poses are of: T_world_raw =
        pose.T_world_camera @ rectifier.T_rectified_raw.
        """
    def rectify(self, raw: Frame) -> Frame:
        """Grey images, and depth. Raises ValueError when the frame is not of the calibrated cameras."""
    def rectify_in_colour(self, raw: Frame) -> Frame:
        """The same, with the left image in colour (blue, green, red) if `raw` has it so: for surfaces."""

class CalibratedCamera:
    """A lens as a calibration found it: pinhole with radial-tangential distortion."""
    @property
    def width(self) -> int:
        """Of the raw images [px]."""
    @property
    def height(self) -> int:
        """Of the raw images [px]."""
    @property
    def fx(self) -> float:
        """Focal length [px]."""
    @property
    def fy(self) -> float:
        """Focal length [px]."""
    @property
    def cx(self) -> float:
        """Principal point [px]."""
    @property
    def cy(self) -> float:
        """Principal point [px]."""
    @property
    def fx_std(self) -> float:
        """Standard deviation [px]."""
    @property
    def fy_std(self) -> float:
        """Standard deviation [px]."""
    @property
    def cx_std(self) -> float:
        """Standard deviation [px]."""
    @property
    def cy_std(self) -> float:
        """Standard deviation [px]."""
    @property
    def distortion(self) -> list[float]:
        """k1, k2, p1, p2, as OpenCV has them."""
    @property
    def rms_px(self) -> float:
        """Reprojection error of a corner [px]."""
    @property
    def coverage(self) -> float:
        """Share of the image with corners, 0 to 1."""
    @property
    def views(self) -> int:
        """Views that it rests on."""
    @property
    def corners(self) -> NDArray[np.float64]:
        """(N, 4): x, y of each corner, and how far from where the camera sees it it was found [px]."""

class BoardCalibration:
    """One camera, or a stereo pair."""
    @property
    def board(self) -> str:
        """By which it was made."""
    @property
    def left(self) -> CalibratedCamera:
        """CalibratedCamera, the only one or the left one."""
    @property
    def right(self) -> CalibratedCamera | None:
        """CalibratedCamera of a pair, else None."""
    @property
    def T_right_left(self) -> Pose:
        """Pose between a pair's cameras, unrectified."""
    @property
    def baseline(self) -> float:
        """Of a pair [m]."""
    @property
    def baseline_std(self) -> float:
        """Standard deviation [m]."""
    @property
    def rms_px(self) -> float:
        """Reprojection error of all corners [px]."""
    def save(self, file: str | PathLike[str]) -> None:
        """Writes the file that FrameRectifier and Source read. Raises RuntimeError."""

class BoardCalibrator:
    """Calibrates one camera or a stereo pair from images of a printed board."""
    def __init__(
        self, board: str, width: int, height: int, *, stereo: bool = False, live: bool = False, views: int = ...
    ) -> None:
        """board: 'chessboard:9x6:0.025' (inner corners, side of a square [m]) or 'charuco:8x6:0.03:0.022' (squares,
        sides of square and marker [m]); width, height [px]: of the raw images; live: somebody moves the board, and
        views are taken while it rests; views: how many different ones are wanted, 10 to 200. Raises ValueError.
        """
    def look(self, raw: Frame) -> None:
        """The next frame, as the camera took it. Raises ValueError when it does not fit."""
    @property
    def complete(self) -> bool:
        """Nothing is missing any more."""
    @property
    def progress(self) -> str:
        """One line for the person with the board: how far it is, and what to do next."""
    @property
    def frames(self) -> int:
        """Looked at."""
    @property
    def found(self) -> int:
        """Of them, with the board (in both images)."""
    @property
    def chosen(self) -> int:
        """Views kept."""
    def calibrate(self) -> BoardCalibration:
        """Solves; seconds. Raises RuntimeError that says why a calibration is refused, and what to do."""

class Map:
    """One version of the map, which never changes and may be held as long as one likes.

    Tables are structured arrays, ascending by id, made when first asked for: read-only views that hold this object.
    While it is held, what the map has replaced since stays in memory, at most memory_bytes().
    """
    @property
    def version(self) -> int:
        """Grows with every version."""
    @property
    def reference(self) -> int | None:
        """The keyframe that the windows are around: the newest, or the one that the camera came back to. None in an
        empty map.
        """
    def camera_pose(self, estimate: PoseEstimate) -> tuple[Pose, int] | None:
        """Pose [m] that this version has for the camera of a frame tracked at any time, by way of its reference
        keyframe or what stands for that now, and the id of its map part: (Pose, part). None: the frame was not tracked,
        or nobody knows (twofold/map.hpp).
        """
    def keyframe_pose(self, id: int) -> tuple[Pose, int] | None:
        """Likewise of a keyframe by its id, which may have been culled."""
    def keyframes(self) -> NDArray[np.void]:
        """(N,) with fields id, part, frame, t_ns [ns], T_world_camera (q: x y z w, t [m]), points (it sees), window (1,
        2: in W1, W2; 0: in neither), has_place (it can be recognised), loaded (it was in the map that the run went on
        with: frame and t_ns are of another recording).
        """
    def points(self, covariance: bool = True) -> NDArray[np.void]:
        """(N,) with fields id, anchor (keyframe it was first seen in), observers (keyframes that see it), part (whose
        world it is in), position (3,) [m], covariance (9,): 3x3 row by row [m^2], NaN where the measurements do not
        determine the point; without covariance all of it NaN, at a tenth of the time.
        """
    def edges(self) -> NDArray[np.void]:
        """(N,) with fields from, to (> from), kind (0: covisible, 1: marginalised), shared_points, T_to_from (q, t)."""
    def loops(self) -> NDArray[np.void]:
        """(N,) loops that this run has closed by appearance, in the order they were found, with fields from (the older
        keyframe; may be gone by now), to (that came back), t_ns (of it), inliers, scale (lengths around to over those
        around from; 1 but for one camera), joins_parts, drift [m] and turned [rad] (by how much the map had position
        and orientation of the keyframe that came back wrong, relative to the older one), travelled [m].
        """
    def parts(self) -> NDArray[np.void]:
        """(N,) with fields id, keyframes (their number); one when everything is connected."""
    def memory_bytes(self) -> int:
        """What it holds, shared with newer versions or not; O(size of the map)."""

class SpaceState(_Enum):
    """What is known of a position."""
    UNKNOWN: ClassVar[SpaceState]
    """never seen, or hidden"""
    FREE: ClassVar[SpaceState]
    """outside every surface"""
    OCCUPIED: ClassVar[SpaceState]
    """inside a surface, as far as the truncation"""

class SurfaceMesh:
    """Triangles, which go round anticlockwise seen from outside. Arrays are read-only views that hold this object."""
    @property
    def positions(self) -> NDArray[np.float32]:
        """(N, 3) float32, in the world [m]: of a run, y points down."""
    @property
    def normals(self) -> NDArray[np.float32]:
        """(N, 3) float32, unit, pointing outside."""
    @property
    def colours(self) -> NDArray[np.uint8]:
        """(N, 3) uint8: red, green, blue."""
    @property
    def triangles(self) -> NDArray[np.uint32]:
        """(M, 3) uint32: numbers of their corners."""
    def save(self, file: str | PathLike[str], up: ArrayLike = ...) -> None:
        """Writes a file of the kind that its name ends in: .ply, .obj or .glb, where `up` (unit) becomes y, which is up
        there. Raises RuntimeError when it cannot, ValueError for other names and for a .glb without triangles.
        """

class DistanceField:
    """A Euclidean signed distance field (ESDF): how far the nearest surface is, whichever way it lies, in the middle of
    each cell of a box.
    """
    @property
    def min_corner(self) -> list[float]:
        """Corner of cell [0, 0, 0] [m]."""
    @property
    def resolution(self) -> float:
        """Edge of a cell [m]."""
    @property
    def distances(self) -> NDArray[np.float32]:
        """(Z, Y, X) float32 [m], negative inside a surface and in unknown cells (unless distances was told otherwise):
        a read-only view.
        """
    @property
    def states(self) -> NDArray[np.uint8]:
        """(Z, Y, X) uint8, numbers of SpaceState: a read-only view."""
    def at(self, positions: ArrayLike) -> NDArray[np.void]:
        """Of positions (N, 3) [m], linear between the middles of cells: (N,) with fields as SurfaceModel.at has them.
        """

class SurfacePiece:
    """The part of a mesh that lies in one cell of a grid."""
    @property
    def cell(self) -> list[int]:
        """Its lowest corner (3,), in cells."""
    @property
    def mesh(self) -> SurfaceMesh:
        """Without triangles: nothing is there any more."""

class SurfaceChanges:
    """What changed in a mesh since a revision."""
    @property
    def revision(self) -> int:
        """That it leads to."""
    @property
    def cell_size(self) -> float:
        """Edge of a cell [m]."""
    @property
    def pieces(self) -> list[SurfacePiece]:
        """SurfacePieces, which replace what was there."""

class SurfaceModel:
    """A dense surface from frames with poses, for planners and models: a truncated signed distance field (TSDF volume).

    Where poses are corrected afterwards, MapSurface moves with the map.
    """
    def __init__(
        self, rig: CameraRig, *, voxel_size: float = 0.05, max_depth: float = 0.0, max_free_depth: float = 0.0, min_stereo_depth: float = 0.0
    ) -> None:
        """voxel_size: distance of two samples [m]. Readings farther than max_depth begin no surface, and free space is
        kept as far as max_free_depth from the camera [m]; 0: as far as there are readings. Stereo depth is looked for
        from min_stereo_depth on [m]; 0: from CameraRig.depth_min, or 0.4 if that is nearer. Raises ValueError for a rig
        without depth.
        """
    def add(self, frame: Frame, T_world_camera: Pose) -> int:
        """Adds the depth of a rectified frame, taken there; says how many pixels had a reading. Raises ValueError for
        images that do not fit the rig.
        """
    def clear(self) -> None:
        """Forgets all."""
    def mesh_changes(self, since: int = 0) -> SurfaceChanges:
        """What changed in the mesh after that revision, as SurfaceChanges; of 0 on, all of it. Only cells that frames
        changed are made anew. Small specks, which `mesh` leaves out, are there.
        """
    def at(self, positions: ArrayLike) -> NDArray[np.void]:
        """What is known of positions: (N, 3) [m] -> (N,) with fields state (number of a SpaceState), distance (to the
        surface [m], positive outside; ends at four voxels) and gradient (3,).
        """
    def distances(
        self, min_corner: ArrayLike, max_corner: ArrayLike, *, resolution: float = 0.1, max_distance: float = 1.0, unknown_is_obstacle: bool = True
    ) -> DistanceField:
        """Of each cell of a box, as far as max_distance, how far the nearest surface is, whichever way it lies: a
        DistanceField. Corners are (3,) [m], resolution and max_distance in metres. Raises ValueError for more than 2^26
        cells. Unknown space is an obstacle: cells there are negative, as far as it is to free space, which the gradient
        leads to. unknown_is_obstacle=False: only surfaces count, and unknown cells are positive, also behind a wall:
        look at `states`.
        """
    def mesh(self) -> SurfaceMesh:
        """The surface as a SurfaceMesh."""
    def memory_bytes(self) -> int:
        """Of all that is kept."""

class SurfaceSnapshot:
    """The surface of a run as it was in one version of its map: it does not change any more. Before the first question
    is answered its submaps are joined, which takes about 0.2 s for 100 MB: prepare() does that on another thread.
    """
    @property
    def map_version(self) -> int:
        """Of the map that it fits; 0: of nothing."""
    @property
    def map_part(self) -> int | None:
        """Whose world positions are in; None: of nothing."""
    def prepare(self) -> None:
        """Joins the submaps now, unless that was done."""
    def camera_pose(self, pose: PoseEstimate, map: Map | None = None) -> Pose | None:
        """T_world_camera of a tracked frame in the world that this surface is in, which a correction of the map may
        have moved against the pose's. map: newer than both (Slam.map()), for reference keyframes that the snapshot does
        not have yet. None where that is not known, or another map part.
        """
    def at(self, positions: ArrayLike) -> NDArray[np.void]:
        """What is known of positions: (N, 3) [m] -> (N,) with fields state (number of a SpaceState), distance (to the
        surface [m], positive outside; ends at four voxels) and gradient (3,).
        """
    def distances(
        self, min_corner: ArrayLike, max_corner: ArrayLike, *, resolution: float = 0.1, max_distance: float = 1.0, unknown_is_obstacle: bool = True
    ) -> DistanceField:
        """Of each cell of a box, as far as max_distance, how far the nearest surface is, whichever way it lies: a
        DistanceField. Corners are (3,) [m], resolution and max_distance in metres. Raises ValueError for more than 2^26
        cells. Unknown space is an obstacle: cells there are negative, as far as it is to free space, which the gradient
        leads to. unknown_is_obstacle=False: only surfaces count, and unknown cells are positive, also behind a wall:
        look at `states`.
        """
    def mesh(self) -> SurfaceMesh:
        """The surface as a SurfaceMesh."""
    def memory_bytes(self) -> int:
        """Of all that is kept."""

class SurfaceUpdate:
    """What MapSurface.update did, and what was left out since the update before."""
    @property
    def fused(self) -> int:
        """Keyframes whose depth was added."""
    @property
    def fused_anew(self) -> int:
        """Depth images that were fused once more, since poses in their submaps had changed."""
    @property
    def no_readings(self) -> int:
        """Keyframes without depth in range."""
    @property
    def beyond_memory(self) -> int:
        """Keyframes left out: memory_mb is reached."""
    @property
    def discarded(self) -> int:
        """Frames that are no keyframes of the map."""
    @property
    def overtaken(self) -> int:
        """Oldest frames of more than 64 that waited."""
    @property
    def waiting(self) -> int:
        """Frames whose keyframes the map does not have yet."""

class MapSurface:
    """The surface of a run's keyframes, which moves with its map: as `twofold run --surface` makes it, whose
    min_stereo_depth is 0.4. Rows of a slipped stereo pair are taken back.
    """
    def __init__(
        self,
        map: Map,
        *,
        voxel_size: float = 0.05,
        max_depth: float = 0.0,
        max_free_depth: float = 0.0,
        min_stereo_depth: float = 0.0,
        memory_mb: float = 2000.0,
    ) -> None:
        """map: of the run, before its first keyframe; it tells the rig. Beyond memory_mb [MiB] no keyframe is added.
        The others: as SurfaceModel.
        """
    def add(self, frame: Frame, number: int) -> None:
        """The frame of a keyframe (PoseEstimate.keyframe), before or after the map has it; number: PoseEstimate.frame.
        Raises ValueError for images that do not fit the rig, and for a number that does not grow.
        """
    def update(self, map: Map) -> SurfaceUpdate:
        """Takes the newest map: submaps move, and all that waits is fused. A SurfaceUpdate says how much, and what was
        left out.
        """
    def mesh_changes(self, since: int = 0) -> SurfaceChanges:
        """What changed in the mesh of the camera's map part after that revision, as of the last update: SurfaceChanges;
        of 0 on, all of it. Small specks, which SurfaceSnapshot.mesh leaves out, are there. What is joined for it takes
        memory beside memory_mb.
        """
    def snapshot(self, part: int | None = None) -> SurfaceSnapshot:
        """As of the end of the last update: a SurfaceSnapshot, of the map part that the camera is in, or of another one
        (PoseEstimate.map_part). Waits for no update.
        """
    def memory_bytes(self) -> int:
        """Of samples and depth images, at the end of the last call of add or update."""

class RunMode(_Enum):
    """On which threads a Slam works, and in what order."""
    THREADED: ClassVar[RunMode]
    """tracker, mapper and loop closer on threads of their own"""
    DETERMINISTIC: ClassVar[RunMode]
    """all within push: same frames, same bytes"""
    REPLAY: ClassVar[RunMode]
    """within push, in the order that `schedule` tells: that run's bytes"""
    STEPPED: ClassVar[RunMode]
    """no threads: the caller's take the steps (Slam.step)"""

class SlamStep(_Enum):
    """What RunMode.STEPPED leaves to the caller."""
    TRACK: ClassVar[SlamStep]
    """locates the camera in the oldest frame that waits"""
    MAP: ClassVar[SlamStep]
    """takes in what the tracker proposed, and optimises the double window"""
    CLOSE_LOOPS: ClassVar[SlamStep]
    """looks up places: of a lost camera, of new keyframes"""

class LateFrames(_Enum):
    """What becomes of a frame whose successor is due, too, when its turn comes."""
    QUEUE: ClassVar[LateFrames]
    """it is tracked: every frame is, however late"""
    DROP: ClassVar[LateFrames]
    """it is dropped once leaving work out is not enough"""
    NEWEST: ClassVar[LateFrames]
    """it is dropped: the newest one wins"""

class InitialPose:
    """Where the camera is in a map made before, as far as somebody knows."""
    def __init__(
        self, T_world_camera: Pose, *, map_part: int | None = None, position_sigma: float = ..., angle_sigma: float = ...
    ) -> None:
        """T_world_camera: of the rectified left camera; map_part: whose world that is, None: the oldest part's;
        position_sigma: standard deviation of each coordinate [m], 0 to 10; angle_sigma: about each axis [rad], 0 to 1.
        """
    @property
    def T_world_camera(self) -> Pose:
        """Pose of the rectified left camera."""
    @property
    def map_part(self) -> int | None:
        """Whose world that is; None: the oldest part's."""
    @property
    def position_sigma(self) -> float:
        """Standard deviation of each coordinate [m]."""
    @property
    def angle_sigma(self) -> float:
        """Standard deviation about each axis [rad]."""

class PushStatus(_Enum):
    """What became of a frame that was pushed."""
    QUEUED: ClassVar[PushStatus]
    """on its way to the tracker"""
    DROPPED: ClassVar[PushStatus]
    """there was no room: the tracker is behind"""
    REFUSED: ClassVar[PushStatus]
    """not to be used, and not counted as a frame"""

class PushResult:
    """Whether a frame was queued, dropped or refused; true when queued."""
    @property
    def status(self) -> PushStatus:
        """PushStatus."""
    @property
    def reason(self) -> str:
        """Of dropped and refused frames: what is wrong."""
    @property
    def frame(self) -> int:
        """The number that its pose has; -1: it was refused, and has none."""
    def __bool__(self) -> bool: ...

class StageTime:
    """What a stage of a thread took, over the whole run."""
    @property
    def thread(self) -> str:
        """tracker, mapper or loop closer."""
    @property
    def stage(self) -> str:
        """Its name."""
    @property
    def count(self) -> int:
        """How often it ran."""
    @property
    def mean_ms(self) -> float:
        """[ms]."""
    @property
    def p50_ms(self) -> float:
        """Median [ms]."""
    @property
    def p99_ms(self) -> float:
        """Of a hundred, one took longer [ms]."""
    @property
    def max_ms(self) -> float:
        """[ms]."""

class Readout:
    """How long a rolling shutter takes, as a run measured it."""
    @property
    def found(self) -> bool:
        """Whether it is one, and the run went on with it."""
    @property
    def seconds(self) -> float:
        """From the first row's exposure to the last one's [s]."""
    @property
    def sigma(self) -> float:
        """Its standard deviation [s]."""
    @property
    def pairs(self) -> int:
        """Pairs of frames that it was measured from."""

class Summary:
    """What a run came to."""
    errors: list[str]
    """What went wrong on the way, a sentence each."""
    @property
    def row_offset(self) -> float:
        """Stereo: rows that right images lie lower than left ones, taken back while tracking [px]; 0: none."""
    @property
    def readout(self) -> Readout | None:
        """Readout of the camera's shutter; None when the rig says it, or nothing was measured."""
    @property
    def frames(self) -> int:
        """Queued or dropped."""
    @property
    def tracked(self) -> int:
        """Frames whose pose was known at once."""
    @property
    def placed_later(self) -> int:
        """Before one camera's start, which said where they were."""
    @property
    def lost(self) -> int:
        """Frames without a pose, unplaced ones included."""
    @property
    def dropped(self) -> int:
        """Frames there was no time or room for."""
    @property
    def trajectory(self) -> Trajectory:
        """Poses of the tracked frames in the final map: those of the map part that has most of them."""
    @property
    def trajectories(self) -> dict[int, Trajectory]:
        """The same of every map part, by the part's id."""
    @property
    def timings(self) -> list[StageTime]:
        """StageTime of each thread's stages."""
    @property
    def notes(self) -> list[str]:
        """Requested settings that could not be applied; how the rig differs from the loaded map's."""

class Updates:
    def next(self, timeout: float) -> PoseEstimate | MapEvent | None: ...
    def close(self) -> None: ...
    def take_missed(self) -> int: ...

class Slam:
    def __init__(
        self,
        rig: CameraRig,
        *,
        mode: RunMode = ...,
        live: bool = False,
        speed: float = 0,
        late: LateFrames | None = None,
        map: str | PathLike[str] | None = None,
        localise_only: bool = False,
        initial_pose: InitialPose | None = None,
        places: bool = True,
        vocabulary: str | PathLike[str] | None = None,
        global_adjustment: bool = True,
        checkpoint: str | PathLike[str] | None = None,
        checkpoint_period: float = ...,
        schedule: str | PathLike[str] | None = None,
        inner_window: int = ...,
        outer_window: int = ...,
        frame_buffers: int = ...,
        tracker_cpu: int | None = None,
        mapper_cpu: int | None = None,
        loop_closer_cpu: int | None = None,
        fifo_priority: int | None = None,
        run_folder: str | PathLike[str] | None = None,
        kept_frames: int = ...,
        trace: str | PathLike[str] | None = None,
    ) -> None: ...
    def push(self, frame: Frame) -> PushResult:
        """Queued, dropped because there is no room, or refused (images that do not fit the rig, time that does not
        grow), and why. Waits for no thread of the engine, but in a deterministic run tracks and maps the frame.
        """
    def has_room(self) -> bool:
        """Whether a push would find room now."""
    def wait_for_room(self, timeout: float) -> bool:
        """Waits at most for timeout [s] (infinity: for ever; not at all when it is negative); for recordings, of which
        no frame should be dropped.
        """
    @property
    def ended(self) -> bool:
        """Whether no frame will be taken any more: finish was called, a thread of the engine has failed, or the
        schedule of a replay has no more frames.
        """
    def step(self, step: SlamStep) -> bool:
        """Of RunMode.STEPPED: takes one step of the engine on this thread. False: there was nothing to do, or another
        thread is taking this step.
        """
    def latest(self) -> PoseEstimate | None:
        """Of the newest frame that was processed, tracked or lost; None before the first. Waits for nobody."""
    def map(self) -> Map:
        """The newest version of the map; O(1)."""
    def held_maps(self) -> tuple[int, int]:
        """How many versions of the map somebody holds, and the oldest of them; 0: none."""
    def save_map(self, file: str | PathLike[str]) -> None:
        """Writes the newest version to a map file, which is replaced atomically. Raises RuntimeError."""
    def pause_mapping(self, paused: bool) -> None:
        """While paused, the map gets no keyframe: the camera is localised in what there is. Waits for nobody."""
    def end_pace(self) -> None:
        """With `speed`: from now on no frame waits for its time, so that finish() returns soon, also when it is called
        by another thread already.
        """
    def errors(self) -> list[str]: ...
    def finish(self) -> Summary: ...
    def view(
        self,
        *,
        title: str = ...,
        port: int = ...,
        bind: str = ...,
        secrets: str | PathLike[str] | None = None,
        truth: Trajectory | None = None,
    ) -> str:
        """Shows the run in a browser while it runs, and returns the address to open, whose token lets one look. port: 0
        for any that is free; bind: any but a loopback address shows camera and map to the network, unencrypted;
        secrets: file that keeps the address's token from run to run; truth: Trajectory of the true path, in any world,
        scaled where one camera has a unit of its own. Nobody waits for who looks. Raises RuntimeError when it is open
        already, the port is taken, or the package was built without the viewer.
        """
    def close_view(self) -> None:
        """Whoever looks gets the last map and is told that the run is over. Happens by itself when the Slam goes.
        view() can open another one then, which shows the map, and what comes from there on.
        """
    @property
    def _updates(self) -> Updates: ...

def feed(source: Source, slam: Slam) -> None: ...
