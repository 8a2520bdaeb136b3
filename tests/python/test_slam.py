from __future__ import annotations

import math
import sys
import threading
import time
from pathlib import Path

import numpy as np
import pytest
from conftest import SCENE, grey

import twofold


def push_all(slam: twofold.Slam, frames: list[twofold.Frame]) -> None:
    for frame in frames:
        assert slam.wait_for_room(60)
        pushed = slam.push(frame)
        assert pushed, pushed.reason


def test_waiting_for_room_ends(rig: twofold.CameraRig, frames: list[twofold.Frame]) -> None:
    with twofold.Slam(rig, mode=twofold.RunMode.DETERMINISTIC) as slam:
        assert slam.wait_for_room(0)
        assert slam.wait_for_room(-0.001)
        with pytest.raises(ValueError, match="timeout"):
            slam.wait_for_room(math.nan)


def test_deterministic_runs_repeat_themselves(frames: list[twofold.Frame], rig: twofold.CameraRig) -> None:
    positions = []
    for _ in range(2):
        with twofold.Slam(rig, mode=twofold.RunMode.DETERMINISTIC) as slam:
            push_all(slam, frames)
            positions.append(slam.finish().trajectory.positions)
    assert positions[0].shape == (40, 3)
    np.testing.assert_array_equal(positions[0], positions[1])


def test_steps_are_taken_from_python_and_replayed(
    frames: list[twofold.Frame], rig: twofold.CameraRig, tmp_path: Path
) -> None:
    step = twofold.SlamStep
    with twofold.Slam(rig, mode=twofold.RunMode.STEPPED, run_folder=tmp_path) as slam:
        assert not slam.step(step.TRACK)
        for frame in frames:
            assert slam.push(frame)
            assert slam.step(step.TRACK)
            while slam.step(step.MAP) or slam.step(step.CLOSE_LOOPS):
                pass
        stepped = slam.finish().trajectory
    with twofold.Slam(rig, mode=twofold.RunMode.REPLAY, schedule=tmp_path / "schedule.log") as slam:
        push_all(slam, frames)
        replayed = slam.finish().trajectory
    assert stepped.positions.shape == (40, 3)
    np.testing.assert_array_equal(stepped.positions, replayed.positions)
    with twofold.Slam(rig) as slam, pytest.raises(RuntimeError, match="STEPPED|kStepped"):
        slam.step(step.TRACK)
    with pytest.raises(ValueError, match="STEPPED"):
        twofold.run(SCENE, mode=twofold.RunMode.STEPPED)


def test_one_camera_is_placed_once_it_has_moved() -> None:
    source = twofold.Source(SCENE, left_only=True)
    assert source.rig.sensor == twofold.Sensor.MONO
    slam = twofold.Slam(source.rig, mode=twofold.RunMode.DETERMINISTIC)
    push_all(slam, list(source))
    summary = slam.finish()
    first = next(iter(slam.poses()))
    assert not first.tracked and first.reason
    assert summary.tracked > 0


def test_poses_come_from_the_queue_in_order(frames: list[twofold.Frame], rig: twofold.CameraRig) -> None:
    slam = twofold.Slam(rig)
    push_all(slam, frames)
    summary = slam.finish()
    poses = list(slam.poses())
    assert [pose.frame for pose in poses] == list(range(40))
    assert summary.tracked == 40
    assert slam.missed() == 0
    latest = slam.latest()
    assert latest is not None and latest.frame == 39
    pose = poses[-1]
    assert pose.tracked and pose.covariance.shape == (6, 6) and pose.velocity.shape == (6,)
    np.testing.assert_allclose(pose.covariance, pose.covariance.T)
    found = slam.map().camera_pose(pose)
    assert found is not None and pose.map_part == found[1]
    np.testing.assert_allclose(found[0].t, summary.trajectory.positions[-1], atol=1e-9)
    np.testing.assert_allclose(pose.T_odom_camera.t, found[0].t, atol=0.02)
    assert slam.map().keyframe_pose(10**6) is None
    assert "exposure to pose" in {time.stage for time in summary.timings}


def test_callbacks_run_on_a_thread_of_their_own(frames: list[twofold.Frame], rig: twofold.CameraRig) -> None:
    seen: list[int] = []
    threads: set[str] = set()

    def on_pose(pose: twofold.PoseEstimate) -> None:
        seen.append(pose.frame)
        threads.add(threading.current_thread().name)

    slam = twofold.Slam(rig)
    slam.on_pose(on_pose)
    with pytest.raises(RuntimeError, match="one reader"):
        slam.updates()
    push_all(slam, frames)
    slam.finish()
    assert seen == list(range(40))
    assert threads == {"twofold callbacks"}


def test_a_callback_that_raises_is_reported(frames: list[twofold.Frame], rig: twofold.CameraRig) -> None:
    calls = []

    def on_pose(pose: twofold.PoseEstimate) -> None:
        calls.append(pose.frame)
        raise KeyError("the table")

    with twofold.Slam(rig) as slam:
        slam.on_pose(on_pose)
        push_all(slam, frames)
        summary = slam.finish()
    assert calls == [0]
    assert summary.tracked == 40
    assert summary.errors == ["the callback of on_pose raised, and is not called any more: KeyError: 'the table'"]


def test_a_slow_callback_loses_poses_but_holds_up_nobody(frames: list[twofold.Frame], rig: twofold.CameraRig) -> None:
    gate = threading.Event()
    seen: list[int] = []
    slam = twofold.Slam(rig, mode=twofold.RunMode.DETERMINISTIC)

    def on_pose(pose: twofold.PoseEstimate) -> None:
        gate.wait(60)
        seen.append(pose.frame)

    slam.on_pose(on_pose)
    last = frames[-1].t_ns
    for turn in range(20):
        push_all(slam, [twofold.Frame(frame.t_ns + turn * (last + 1), frame.left, frame.right) for frame in frames])
    gate.set()
    summary = slam.finish()
    assert summary.frames == 800
    missed = slam.missed()
    assert missed > 0
    assert len(seen) < 800


def test_what_cannot_be_used_is_refused_with_a_reason(frames: list[twofold.Frame], rig: twofold.CameraRig) -> None:
    slam = twofold.Slam(rig, mode=twofold.RunMode.DETERMINISTIC)
    small = slam.push(twofold.Frame(0, grey(48, 64), grey(48, 64)))
    assert not small and small.status == twofold.PushStatus.REFUSED
    assert "64x48" in small.reason
    assert slam.push(frames[1])
    assert "time does not grow" in slam.push(frames[0]).reason
    slam.finish()
    assert "finish" in slam.push(frames[2]).reason
    with pytest.raises(ValueError, match="inner_window"):
        twofold.Slam(rig, inner_window=0)
    with pytest.raises(RuntimeError, match="/nowhere"):
        twofold.Slam(rig, map="/nowhere/at.all")


def test_maps_are_read_only_views_that_hold_their_version(finished: twofold.Run) -> None:
    map_now = finished.slam.map()
    points = map_now.points()
    assert set(points.dtype.names or ()) == {"id", "anchor", "observers", "part", "position", "covariance"}
    assert points.base is map_now
    assert np.shares_memory(points, map_now.points())
    assert not points.flags.writeable
    held = finished.slam.held_maps()
    assert held[0] >= 1
    version = map_now.version
    keyframes, edges, parts = map_now.keyframes(), map_now.edges(), map_now.parts()
    loops = map_now.loops()
    del map_now
    assert version > 0
    assert len(keyframes) > 1 and keyframes["T_world_camera"]["t"].shape == (len(keyframes), 3)
    assert len(points) > 30 and np.isfinite(points["position"]).all()
    assert (points["covariance"][:, 0] > 0).any()
    assert set(edges["from"]) <= set(keyframes["id"])
    assert (edges["from"] < edges["to"]).all()
    assert parts["keyframes"].sum() == len(keyframes)
    assert not keyframes["loaded"].any()
    assert len(loops) == 0  # a desk, seen once
    columns = {"from", "to", "t_ns", "inliers", "scale", "joins_parts", "drift", "turned", "travelled"}
    assert set(loops.dtype.names or ()) == columns


def test_a_map_survives_its_file(finished: twofold.Run, tmp_path: Path) -> None:
    finished.slam.save_map(tmp_path / "desk.tfm")
    with twofold.run(SCENE, map=tmp_path / "desk.tfm", localise_only=True, mode=twofold.RunMode.DETERMINISTIC) as run:
        placed = sum(pose.tracked for pose in run)
    assert placed > 20


def test_a_camera_begins_where_it_is_said_to_be(finished: twofold.Run, frames: list[twofold.Frame], rig: twofold.CameraRig, tmp_path: Path) -> None:
    finished.slam.save_map(tmp_path / "desk.tfm")

    def first_pose(T_world_camera: twofold.Pose) -> twofold.PoseEstimate | None:
        pose = twofold.InitialPose(T_world_camera, position_sigma=0.02, angle_sigma=0.01)
        assert (pose.map_part, pose.position_sigma, pose.angle_sigma) == (None, 0.02, 0.01)
        with twofold.Slam(rig, mode=twofold.RunMode.DETERMINISTIC, map=tmp_path / "desk.tfm", localise_only=True, initial_pose=pose) as slam:
            slam.push(frames[0])
            return slam.latest()

    there = finished.slam.finish().trajectory.pose(0)
    found = first_pose(there)
    assert found is not None and found.tracked
    np.testing.assert_allclose(found.T_world_camera.t, there.t, atol=0.02)
    wrong = first_pose(there @ twofold.Pose([0, 0, 0], [0, 1, 0, 0]))
    assert wrong is not None and wrong.state == twofold.TrackingState.UNPLACED
    with pytest.raises(ValueError, match="initial_pose needs options.map"):
        twofold.Slam(rig, initial_pose=twofold.InitialPose(there))


def test_the_interpreters_lock_holds_up_neither_feeder_nor_tracker() -> None:
    run = twofold.run(SCENE)
    updates = run.updates()
    next(updates)
    interval = sys.getswitchinterval()
    sys.setswitchinterval(100)  # nobody else gets the lock while this thread computes
    try:
        deadline = time.monotonic() + 60
        while True:
            latest = run.slam.latest()
            if (latest is not None and latest.frame >= 30) or time.monotonic() > deadline:
                break
    finally:
        sys.setswitchinterval(interval)
    assert latest is not None and latest.frame >= 30
    run.finish()


def test_there_is_one_reader(rig: twofold.CameraRig) -> None:
    with twofold.Slam(rig) as slam:
        slam.updates()
        with pytest.raises(RuntimeError, match="one reader"):
            slam.on_pose(lambda pose: None)
    with twofold.Slam(rig) as slam:
        slam.on_event(lambda event: None)
        with pytest.raises(RuntimeError, match="one reader"):
            slam.poses()


def test_what_is_not_known_is_said(frames: list[twofold.Frame], rig: twofold.CameraRig) -> None:
    with twofold.Slam(rig, mode=twofold.RunMode.DETERMINISTIC) as slam:
        push_all(slam, frames[:3])
        slam.finish()
        poses = list(slam.poses())
    assert poses[0].covariance_known and not poses[0].covariance.any(), "it defines the world"
    assert poses[2].covariance_known and poses[2].covariance.any()


def test_a_recording_is_played_at_its_own_pace_and_leaves_checkpoints_and_a_trace(
    frames: list[twofold.Frame], rig: twofold.CameraRig, tmp_path: Path
) -> None:
    with twofold.Slam(
        rig,
        speed=2,
        late=twofold.LateFrames.QUEUE,
        checkpoint=tmp_path / "map.tfm",
        checkpoint_period=0.1,
        trace=tmp_path / "trace.json",
    ) as slam:
        push_all(slam, frames)
        summary = slam.finish()
        poses = list(slam.poses())
    assert summary.tracked == 40 and not summary.errors
    passed = [pose.exposed_ns - poses[0].exposed_ns for pose in poses]
    assert passed == pytest.approx([(pose.t_ns - poses[0].t_ns) / 2 for pose in poses], abs=2)
    assert (tmp_path / "map.tfm").stat().st_size > 0
    assert "traceEvents" in (tmp_path / "trace.json").read_text()
    with pytest.raises(ValueError, match="options.late"):
        twofold.Slam(rig, late=twofold.LateFrames.DROP)


def test_the_pace_ends_for_who_does_not_want_to_wait(frames: list[twofold.Frame], rig: twofold.CameraRig) -> None:
    begin = time.monotonic()
    slam = twofold.Slam(rig, speed=0.002)  # frames are due half a minute after each other
    push_all(slam, frames[:4])
    slam.end_pace()
    assert slam.finish().tracked == 4
    with pytest.raises(KeyboardInterrupt), twofold.Slam(rig, speed=0.002) as slam:
        push_all(slam, frames[:4])
        raise KeyboardInterrupt
    assert time.monotonic() - begin < 20


def test_while_mapping_is_paused_no_keyframe_is_made(frames: list[twofold.Frame], rig: twofold.CameraRig) -> None:
    with twofold.Slam(rig, mode=twofold.RunMode.DETERMINISTIC) as slam:
        push_all(slam, frames[:10])
        slam.pause_mapping(True)
        version = slam.map().version
        push_all(slam, frames[10:])
        assert slam.map().version == version
        assert slam.finish().tracked == 40
