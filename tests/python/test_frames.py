from __future__ import annotations

import sys
import threading
from pathlib import Path

import numpy as np
import pytest
from conftest import grey
from numpy.typing import NDArray

import twofold


def test_pixels_stay_where_they_are() -> None:
    left, right = grey(48, 64), grey(48, 64)
    depth = grey(48, 64).astype(np.uint16)
    frame = twofold.Frame(7, left, right, depth)
    assert frame.t_ns == 7
    assert frame.copied == ()
    assert np.shares_memory(frame.left, left)
    assert frame.right is not None and np.shares_memory(frame.right, right)
    assert frame.depth is not None and np.shares_memory(frame.depth, depth)
    assert not frame.left.flags.writeable


def test_depth_may_be_in_metres() -> None:
    depth = grey(48, 64).astype(np.float32) / 100
    frame = twofold.Frame(7, grey(48, 64), depth=depth)
    assert frame.depth is not None and frame.depth.dtype == np.float32 and np.shares_memory(frame.depth, depth)
    rig = twofold.CameraRig(sensor=twofold.Sensor.RGBD, width=64, height=48, fx=60, fy=60, cx=32, cy=24)
    with twofold.Slam(rig, mode=twofold.RunMode.DETERMINISTIC) as slam:
        assert slam.push(frame)


def test_a_cut_out_of_a_larger_image_is_not_copied() -> None:
    both = grey(48, 128)
    frame = twofold.Frame(0, both[:, :64], both[:, 64:])
    assert frame.copied == ()
    assert frame.right is not None
    np.testing.assert_array_equal(frame.right, both[:, 64:])


@pytest.mark.parametrize(
    "image", [grey(64, 48).T, grey(48, 64)[:, ::-1], grey(48, 64)[::-1], np.broadcast_to(grey(1, 64), (48, 64))]
)
def test_other_layouts_are_copied_and_named(image: NDArray[np.uint8]) -> None:
    frame = twofold.Frame(0, grey(48, 64), image)
    assert frame.copied == ("right",)
    assert frame.right is not None
    np.testing.assert_array_equal(frame.right, image)


def test_what_is_no_image_is_named() -> None:
    with pytest.raises(TypeError, match="left: an image must be a numpy array"):
        twofold.Frame(0, [[1, 2], [3, 4]])  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="right: must be uint8"):
        twofold.Frame(0, grey(4, 4), grey(4, 4).astype(np.float32))
    with pytest.raises(ValueError, match="depth: must be uint16 or float32"):
        twofold.Frame(0, grey(4, 4), depth=grey(4, 4))  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="left: must be uint8 of shape"):
        twofold.Frame(0, np.zeros((4, 4, 4), np.uint8))
    with pytest.raises(ValueError, match="'bgr' or 'rgb'"):
        twofold.Frame(0, grey(4, 4), colours="gbr")


def test_colour_is_turned_to_grey_in_its_order(rig: twofold.CameraRig) -> None:
    reds = np.zeros((rig.height, rig.width, 3), np.uint8)
    reds[..., 0] = 255
    frame = twofold.Frame(0, reds, reds, colours="rgb")
    assert frame.left.shape == (rig.height, rig.width, 3)
    with twofold.Slam(rig, mode=twofold.RunMode.DETERMINISTIC) as slam:
        assert slam.push(frame)


def test_arrays_are_given_back_when_the_engine_is_done_with_them(
    frames: list[twofold.Frame], rig: twofold.CameraRig
) -> None:
    arrays = [(np.array(frame.left), np.array(frame.right)) for frame in frames]
    free = sys.getrefcount(arrays[0][0])
    with twofold.Slam(rig) as slam:
        for frame, (left, right) in zip(frames, arrays, strict=True):
            assert slam.wait_for_room(60)
            assert slam.push(twofold.Frame(frame.t_ns, left, right))
    del left, right
    assert [sys.getrefcount(pair[0]) for pair in arrays] == [free] * len(arrays)


def test_sources_give_frames_and_truth() -> None:
    source = twofold.Source("synthetic:desk?frames=3&sensor=rgbd&width=64&height=48")
    assert source.frame_count == 3
    assert not source.is_live
    assert source.rig.sensor == twofold.Sensor.RGBD
    frames = list(source)
    assert len(frames) == 3
    assert frames[0].right is None
    assert frames[0].depth is not None and frames[0].depth.dtype == np.uint16
    np.testing.assert_array_equal(source.ground_truth.t_ns, [frame.t_ns for frame in frames])
    with pytest.raises(RuntimeError, match="/nowhere"):
        twofold.Source("euroc:/nowhere")


def test_threads_that_ask_a_source_for_frames_take_turns() -> None:
    source = twofold.Source("synthetic:desk?frames=60&sensor=rgbd&width=64&height=48")
    taken: list[list[int]] = [[], [], [], []]
    threads = [threading.Thread(target=lambda times=times: times.extend(frame.t_ns for frame in source)) for times in taken]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert sorted(t_ns for times in taken for t_ns in times) == list(source.ground_truth.t_ns)


def test_rectifiers_follow_the_calibration(stereo_yaml: Path) -> None:
    rectifier = twofold.FrameRectifier(stereo_yaml)
    assert rectifier.rig.width == 64
    assert rectifier.rig.baseline == pytest.approx(0.1)
    assert rectifier.T_rectified_raw.t.tolist() == [0, 0, 0], "nothing is turned here"
    left = grey(48, 64)
    frame = rectifier.rectify(twofold.Frame(5, left, left))
    assert frame.t_ns == 5
    np.testing.assert_array_equal(frame.left, left)
    with pytest.raises(ValueError, match="right"):
        rectifier.rectify(twofold.Frame(5, left, grey(48, 32)))
    with pytest.raises(RuntimeError, match="nowhere.yaml"):
        twofold.FrameRectifier("nowhere.yaml")


def info_of(model: str, D: list[float]) -> twofold.CameraInfo:
    return twofold.CameraInfo(width=64, height=48, K=[50, 0, 31.5, 0, 51, 23.5, 0, 0, 1], D=D, distortion_model=model)


def test_a_rectifier_of_numbers_is_that_of_their_file(tmp_path: Path) -> None:
    left = info_of("plumb_bob", [-0.2, 0.03, 0.001, -0.002, 0.01])
    right = info_of("equidistant", [0.02, -0.01, 0.003, -0.001])
    (tmp_path / "pair.yaml").write_text(
        "sensor: stereo\ncameras:\n"
        "  - {size: [64, 48], intrinsics: [50, 51, 31.5, 23.5], distortion: {model: radtan, coefficients: [-0.2, 0.03, 0.001, -0.002, 0.01]}}\n"
        "  - {size: [64, 48], intrinsics: [50, 51, 31.5, 23.5], distortion: {model: equidistant, coefficients: [0.02, -0.01, 0.003, -0.001]}}\n"
        "T_right_left: [1, 0, 0, -0.1,  0, 1, 0, 0,  0, 0, 1, 0,  0, 0, 0, 1]\n"
    )
    from_file = twofold.FrameRectifier(tmp_path / "pair.yaml")
    from_pose = twofold.FrameRectifier(left, right, T_right_left=twofold.Pose([-0.1, 0, 0], [0, 0, 0, 1]))
    P = np.array([[52, 0, 32, 0], [0, 52, 24, 0], [0, 0, 1, 0]])
    shifted = P - [[0, 0, 0, 5.2], [0, 0, 0, 0], [0, 0, 0, 0]]
    from_messages = twofold.FrameRectifier(
        *(
            twofold.CameraInfo(width=64, height=48, K=info.K, D=info.D, distortion_model=info.distortion_model, R=np.eye(3), P=P)
            for info, P in ((left, P), (right, shifted))
        )
    )
    raw = twofold.Frame(5, grey(48, 64), grey(48, 64)[::-1])
    expected = from_file.rectify(raw)
    assert not np.array_equal(expected.left, raw.left)
    for rectifier in (from_pose, from_messages):
        assert rectifier.rig.baseline == pytest.approx(0.1)
        frame = rectifier.rectify(raw)
        assert frame.right is not None and expected.right is not None
        np.testing.assert_array_equal(frame.left, expected.left)
        np.testing.assert_array_equal(frame.right, expected.right)
    assert twofold.FrameRectifier(left).rig.sensor == twofold.Sensor.MONO
    assert twofold.FrameRectifier(left, sensor=twofold.Sensor.RGBD).rig.sensor == twofold.Sensor.RGBD


def test_numbers_that_make_no_camera_are_refused() -> None:
    info = info_of("plumb_bob", [0.1])
    assert (info.K.shape, info.R.shape, info.P.shape, info.D.tolist()) == ((3, 3), (3, 3), (3, 4), [0.1])
    with pytest.raises(ValueError, match="K must have 9 numbers, has 4"):
        twofold.CameraInfo(width=64, height=48, K=[50, 51, 31, 23])
    with pytest.raises(ValueError, match="'plumb_bob' has 6 coefficients"):
        twofold.FrameRectifier(info_of("plumb_bob", [1, 1, 1, 1, 1, 1]))
    with pytest.raises(ValueError, match=r"no baseline"):
        twofold.FrameRectifier(info, info)


def test_a_calibrator_says_what_is_missing_and_refuses() -> None:
    calibrator = twofold.BoardCalibrator("chessboard:9x6:0.025", 64, 48)
    assert not calibrator.complete and calibrator.progress
    calibrator.look(twofold.Frame(1, grey(48, 64)))
    assert (calibrator.frames, calibrator.found, calibrator.chosen) == (1, 0, 0)
    with pytest.raises(RuntimeError, match="the board was never seen"):
        calibrator.calibrate()
    with pytest.raises(ValueError, match="32x"):
        calibrator.look(twofold.Frame(2, grey(48, 32)))
    with pytest.raises(ValueError, match="board"):
        twofold.BoardCalibrator("paper", 64, 48)


def test_rigs_and_sources_say_what_they_are(rig: twofold.CameraRig) -> None:
    assert repr(rig).startswith("<CameraRig STEREO: 320x240, fx 210.00")
    assert repr(twofold.Source("synthetic:desk?frames=7&width=320&height=240")) == f"<Source of 7 frames: {rig!r}>"
    mono = twofold.CameraRig(sensor=twofold.Sensor.MONO, width=64, height=48, fx=50, fy=50, cx=32, cy=24)
    assert twofold.Slam(mono, mode=twofold.RunMode.DETERMINISTIC).finish().frames == 0
    with pytest.raises(ValueError, match="rig.baseline must be in \\(0, 20\\], is 0"):
        twofold.Slam(twofold.CameraRig(width=64, height=48, fx=50, fy=50, cx=32, cy=24))
