from __future__ import annotations

import gc
import signal
import subprocess
import sys
import weakref
from pathlib import Path

import numpy as np
import pytest
from conftest import SCENE
from numpy.typing import NDArray

import twofold


def test_a_run_gives_every_pose() -> None:
    frames = [pose.frame for pose in twofold.run(SCENE)]
    assert frames == list(range(40))


def test_a_recording_waits_for_who_iterates() -> None:
    with twofold.run("synthetic:desk?frames=700&width=64&height=48", places=False) as run:
        frames = [pose.frame for pose in run]
        assert frames == list(range(700))
        assert run.slam.missed() == 0


def test_a_replay_ends_with_its_schedule(tmp_path: Path) -> None:
    """As of a run that was killed."""
    short = "synthetic:desk?frames=20&width=64&height=48"
    with twofold.run(short, mode=twofold.RunMode.DETERMINISTIC, run_folder=tmp_path) as run:
        assert len(list(run)) == 20
    schedule = tmp_path / "schedule.log"
    source = twofold.Source(short.replace("20", "30"))
    with twofold.run(source, mode=twofold.RunMode.REPLAY, schedule=schedule) as run:
        assert len(list(run)) == 20
        assert run.slam.ended


def test_a_loop_may_be_left() -> None:
    run = twofold.run("synthetic:desk?frames=100000&width=64&height=48")
    for pose in run:
        if pose.frame == 5:
            break
    summary = run.finish()
    assert 5 < summary.frames < 100000
    gone = weakref.ref(run)
    del run
    gc.collect()
    assert gone() is None


def test_what_the_source_raises_comes_at_the_end(tmp_path: object) -> None:
    folder = f"{tmp_path}/images"
    record(folder)
    poses = twofold.run(f"images:{folder}?fps=30&fx=50&fy=50&cx=31&cy=23&baseline=0.1")
    with pytest.raises(RuntimeError, match="3.png"):
        list(poses)


def record(folder: str) -> None:
    """Five image pairs, of which the fourth is of another size."""
    cv2 = pytest.importorskip("cv2")
    from pathlib import Path

    for side in "left", "right":
        (Path(folder) / side).mkdir(parents=True)
        for i in range(5):
            file = Path(folder) / side / f"{i}.png"
            cv2.imwrite(str(file), np.full((48, 64 if i != 3 else 60), 40 * i, np.uint8))


def python(script: str, *, interrupt: bool = False) -> subprocess.CompletedProcess[str]:
    # Jobs in the background of a script are started deaf to Ctrl-C, and what they start inherits that.
    process = subprocess.Popen(
        [sys.executable, "-c", script],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_DFL),
    )
    if interrupt:
        assert process.stdout is not None
        process.stdout.readline()  # the loop runs
        process.send_signal(signal.SIGINT)
    out, error = process.communicate(timeout=120)
    return subprocess.CompletedProcess(process.args, process.returncode, out, error)


ENDLESS = "synthetic:desk?frames=1000000&width=64&height=48"


def test_ctrl_c_works() -> None:
    done = python(
        f"import twofold\nfor pose in twofold.run({ENDLESS!r}):\n    print(pose.frame, flush=True)", interrupt=True
    )
    assert "KeyboardInterrupt" in done.stderr
    assert done.returncode == -signal.SIGINT


def test_a_script_may_end_in_the_middle() -> None:
    done = python(
        f"import twofold\nrun = twofold.run({ENDLESS!r})\nnext(iter(run))\n"
        "slam = twofold.Slam(run.source.rig)\nslam.on_pose(print)\n"
    )
    assert (done.returncode, done.stderr) == (0, "")


def test_runs_can_be_compared_with_the_truth(finished: twofold.Run) -> None:
    trajectory = finished.finish().trajectory
    error = twofold.compare(trajectory, finished.source.ground_truth)
    assert error.pairs == 40
    assert error.ate_rmse < 0.005
    scaled = twofold.Trajectory(trajectory.t_ns, trajectory.positions * 0.5, trajectory.orientations)
    similar = twofold.compare(scaled, trajectory, align=twofold.AlignBy.SIMILARITY)
    assert similar.scale == pytest.approx(2)
    with pytest.raises(ValueError):
        twofold.compare(twofold.Trajectory([], np.zeros((0, 3)), np.zeros((0, 4))), trajectory)


def test_trajectories_survive_their_file(finished: twofold.Run, tmp_path: object) -> None:
    trajectory = finished.finish().trajectory
    trajectory.save(f"{tmp_path}/poses.txt")
    read = twofold.load_trajectory(f"{tmp_path}/poses.txt")
    np.testing.assert_array_equal(read.t_ns, trajectory.t_ns)
    np.testing.assert_allclose(read.positions, trajectory.positions, atol=1e-6)


def test_poses_compose() -> None:
    quarter = np.sqrt(0.5)
    T_a_b = twofold.Pose([1, 0, 0], [0, 0, quarter, quarter])  # a quarter turn about z
    np.testing.assert_allclose(T_a_b @ [1, 0, 0], [1, 1, 0], atol=1e-12)
    points = np.array([[0.0, 1, 2], [3, 4, 5]])
    homogeneous = np.column_stack([points, np.ones(2)])
    np.testing.assert_allclose(T_a_b @ points, (homogeneous @ T_a_b.matrix().T)[:, :3], atol=1e-12)
    np.testing.assert_allclose((T_a_b @ T_a_b.inverse()).matrix(), np.eye(4), atol=1e-12)
    assert T_a_b == twofold.Pose(T_a_b.t, T_a_b.q)
    assert not T_a_b.t.flags.writeable
    with pytest.raises(ValueError, match="length 1"):
        twofold.Pose([0, 0, 0], [0, 0, 0, 2])


def test_poses_are_made_of_matrices() -> None:
    T_a_b = twofold.Pose([1, 2, 3], np.array([0.1, -0.2, 0.3, 0.9]) / np.linalg.norm([0.1, -0.2, 0.3, 0.9]))
    again = twofold.Pose.from_matrix(T_a_b.matrix())
    np.testing.assert_allclose(again.matrix(), T_a_b.matrix(), atol=1e-14)
    rounded = twofold.Pose.from_matrix(T_a_b.matrix().astype(np.float32))
    np.testing.assert_allclose(rounded.matrix(), T_a_b.matrix(), atol=1e-6)
    assert np.linalg.norm(rounded.q) == pytest.approx(1, abs=1e-15)
    mirrored, scaled, projective, unknown = (T_a_b.matrix() for _ in range(4))
    mirrored[:3, 0] *= -1
    scaled[:3, :3] *= 1.01
    projective[3, 0] = 0.1
    unknown[0, 3] = np.nan
    for wrong in [mirrored, scaled, projective, unknown]:
        with pytest.raises(ValueError, match="rigid motion"):
            twofold.Pose.from_matrix(wrong)
    with pytest.raises(ValueError, match="shape"):
        twofold.Pose.from_matrix(np.eye(3))


def test_times_of_a_trajectory_are_whole_nanoseconds() -> None:
    with pytest.raises(TypeError, match="nanoseconds"):
        twofold.Trajectory([1.5, 2.5], np.zeros((2, 3)), np.tile([0, 0, 0, 1], (2, 1)))


def test_poses_are_of_finite_numbers_and_unit_quaternions() -> None:
    for value in [np.nan, np.inf]:
        with pytest.raises(ValueError, match=f"t must be finite, is .0, {value}, 0"):
            twofold.Pose([0, value, 0], [0, 0, 0, 1])
        with pytest.raises(ValueError, match=f"q must be finite, is .{value}, 0, 0, 1"):
            twofold.Pose([0, 0, 0], [value, 0, 0, 1])
    with pytest.raises(ValueError, match="of length 1.5"):
        twofold.Pose([0, 0, 0], [0, 0, 0, 1.5])
    np.testing.assert_array_equal(twofold.Pose([0, 0, 0], [0, 0, 0, 1.004]).q, [0, 0, 0, 1])


def test_rows_of_a_trajectory_are_checked() -> None:
    t_ns, positions, orientations = [1, 2, 3], np.zeros((3, 3)), np.tile([0.0, 0, 0, 1], (3, 1))

    def changed(array: NDArray[np.float64], value: float) -> NDArray[np.float64]:
        array = array.copy()
        array[1, 2] = value
        return array

    assert len(twofold.Trajectory(t_ns, positions, orientations)) == 3
    for value in [np.nan, np.inf]:
        with pytest.raises(ValueError, match=f"row 1: t must be finite, is .0, 0, {value}"):
            twofold.Trajectory(t_ns, changed(positions, value), orientations)
        with pytest.raises(ValueError, match=f"row 1: q must be finite, is .0, 0, {value}, 1"):
            twofold.Trajectory(t_ns, positions, changed(orientations, value))
    with pytest.raises(ValueError, match="row 1: q must be of length 1, is .0, 0, 2, 1. of length 2.236"):
        twofold.Trajectory(t_ns, positions, changed(orientations, 2))
    with pytest.raises(ValueError, match="row 2: t_ns must grow, is 2 after 2"):
        twofold.Trajectory([1, 2, 2], positions, orientations)
    rounded = orientations * 0.999
    np.testing.assert_array_equal(twofold.Trajectory(t_ns, positions, rounded).orientations, orientations)


def test_sources_may_be_paths(tmp_path: Path) -> None:
    sources: list[Path | str] = [tmp_path / "none", str(tmp_path / "none")]
    for source in sources:
        with pytest.raises(RuntimeError, match="none: no such file or folder"):
            twofold.run(source)
        with pytest.raises(RuntimeError, match="none: no such file or folder"):
            twofold.Source(source)
    with pytest.raises(TypeError):
        twofold.run(5)  # type: ignore[arg-type]
