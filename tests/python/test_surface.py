from __future__ import annotations

import struct
import subprocess
import sys
import threading
import zlib
from pathlib import Path

import numpy as np
import pytest

import twofold

SCENE = "synthetic:desk?rounds=1&frames=160&width=160&height=120&sensor=rgbd"


def wall(rig: twofold.CameraRig, metres: float) -> twofold.Frame:
    left = np.full((rig.height, rig.width, 3), (30, 60, 200), np.uint8)
    depth = np.full((rig.height, rig.width), round(metres / rig.depth_unit), np.uint16)
    return twofold.Frame(0, left, depth=depth)


@pytest.fixture(scope="module")
def rig() -> twofold.CameraRig:
    return twofold.Source(SCENE).rig


def test_a_model_tells_what_is_free_and_how_far_the_wall_is(rig: twofold.CameraRig, tmp_path: Path) -> None:
    model = twofold.SurfaceModel(rig, voxel_size=0.02)
    assert model.add(wall(rig, 2.0), twofold.Pose()) == rig.width * rig.height
    known = model.at(np.array([[0, 0, 1.0], [0, 0, 1.96], [0, 0, 2.03], [0, 0, 5]]))
    assert [twofold.SpaceState(int(state)) for state in known["state"]] == [
        twofold.SpaceState.FREE,
        twofold.SpaceState.FREE,
        twofold.SpaceState.OCCUPIED,
        twofold.SpaceState.UNKNOWN,
    ]
    assert known["distance"][1] == pytest.approx(0.04, abs=0.01)
    assert known["gradient"].shape == (4, 3)
    assert known["gradient"][1][2] == pytest.approx(-1, abs=0.1)

    box = ([-0.1, -0.2, 1.0], [0.1, 0.2, 1.9])
    hidden = model.distances([-0.1, -0.1, 2.2], [0.1, 0.1, 2.4], resolution=0.1, max_distance=1)
    assert (hidden.distances < -0.2).all(), "unknown space is an obstacle"
    field = model.distances(*box, resolution=0.1, max_distance=1, unknown_is_obstacle=False)
    assert field.distances.shape == field.states.shape == (9, 4, 2)
    assert field.distances[0, 0, 0] == pytest.approx(0.95, abs=0.03)
    assert field.at(np.array([[0.0, 0, 1.55]]))["distance"][0] == pytest.approx(0.45, abs=0.03)
    assert not field.distances.flags.owndata and not field.distances.flags.writeable

    mesh = model.mesh()
    assert mesh.positions.shape == mesh.normals.shape == mesh.colours.shape
    assert np.abs(mesh.positions[:, 2] - 2).max() < 0.01
    assert mesh.triangles.max() < len(mesh.positions)
    assert (np.abs(mesh.colours.astype(int) - (200, 60, 30)) <= 2).all()
    positions = mesh.positions
    del mesh, model, field
    assert np.isfinite(positions).all()


def test_meshes_are_saved_by_the_kind_of_their_name(rig: twofold.CameraRig, tmp_path: Path) -> None:
    model = twofold.SurfaceModel(rig, voxel_size=0.05)
    model.add(wall(rig, 1.5), twofold.Pose())
    mesh = model.mesh()
    for name in ("wall.ply", "wall.glb", "wall.obj"):
        mesh.save(tmp_path / name)
        assert (tmp_path / name).stat().st_size > 12 * len(mesh.positions)
    assert (tmp_path / "wall.glb").read_bytes()[:4] == b"glTF"
    with pytest.raises(ValueError, match="must end in"):
        mesh.save(tmp_path / "wall.stl")
    with pytest.raises(RuntimeError):
        mesh.save(tmp_path / "none" / "wall.ply")


def test_what_makes_no_sense_is_refused(rig: twofold.CameraRig) -> None:
    with pytest.raises(ValueError, match="voxel_size"):
        twofold.SurfaceModel(rig, voxel_size=0)
    model = twofold.SurfaceModel(rig)
    with pytest.raises(ValueError, match="depth"):
        model.add(twofold.Frame(0, np.zeros((rig.height, rig.width), np.uint8)), twofold.Pose())
    with pytest.raises(ValueError, match=r"\(N, 3\)"):
        model.at([0.0, 0, 1])
    with pytest.raises(ValueError, match="max_corner"):
        model.distances([0, 0, 0], [0, 0, 0])
    assert model.memory_bytes() == 0
    model.add(wall(rig, 1.5), twofold.Pose())
    assert model.memory_bytes() > 0
    model.clear()
    assert len(model.mesh().triangles) == 0


def test_what_changed_in_a_mesh_is_told_in_cells(rig: twofold.CameraRig) -> None:
    model = twofold.SurfaceModel(rig, voxel_size=0.05)
    model.add(wall(rig, 1.5), twofold.Pose())
    all_of_it = model.mesh_changes()
    assert all_of_it.cell_size == pytest.approx(0.4)
    pieces = all_of_it.pieces
    assert sum(len(piece.mesh.triangles) for piece in pieces) == len(model.mesh().triangles)
    assert len(pieces[0].cell) == 3
    cells = {tuple(piece.cell) for piece in pieces}
    revision = all_of_it.revision
    del all_of_it, pieces
    assert model.mesh_changes(revision).pieces == []
    model.clear()
    gone = model.mesh_changes(revision).pieces
    assert {tuple(piece.cell) for piece in gone} == cells
    assert all(len(piece.mesh.triangles) == 0 for piece in gone)


def write_png(file: Path, rgb: tuple[int, int, int], height: int, width: int) -> None:
    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    header = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    rows = (b"\0" + bytes(rgb) * width) * height
    file.write_bytes(
        b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", header) + chunk(b"IDAT", zlib.compress(rows)) + chunk(b"IEND", b"")
    )


def test_sources_and_rectifiers_give_colours(tmp_path: Path, stereo_yaml: Path) -> None:
    for camera in ("image_2", "image_3"):
        (tmp_path / camera).mkdir()
        for name in ("000000.png", "000001.png"):
            write_png(tmp_path / camera / name, (200, 60, 30), 48, 64)
    (tmp_path / "times.txt").write_text("0.0\n0.1\n")
    (tmp_path / "calib.txt").write_text(
        "P2: 50 0 31.5 0 0 50 23.5 0 0 0 1 0\nP3: 50 0 31.5 -5 0 50 23.5 0 0 0 1 0\n"
    )
    source = twofold.Source(f"kitti:{tmp_path}")
    frame = source.next()
    assert frame is not None and frame.left.ndim == 2
    coloured = source.in_colour(frame)
    del frame
    assert (coloured.left == (30, 60, 200)).all() and coloured.left.shape == (48, 64, 3)
    assert coloured.right is not None and coloured.right.shape == (48, 64)

    raw = twofold.Frame(5, coloured.left.copy(), coloured.left.copy())
    assert (twofold.FrameRectifier(stereo_yaml).rectify_in_colour(raw).left == (30, 60, 200)).all()


def test_a_runs_surface_follows_its_map() -> None:
    source = twofold.Source(SCENE)
    with twofold.Slam(source.rig, mode=twofold.RunMode.DETERMINISTIC) as slam:
        surface = twofold.MapSurface(slam.map(), voxel_size=0.04)
        early = surface.snapshot()
        assert early.map_part is None
        for frame in source:
            slam.push(frame)
            pose = slam.latest()
            if pose is not None and pose.keyframe:
                surface.add(frame, pose.frame)
                surface.update(slam.map())
                early = early if early.map_version else surface.snapshot()
        triangles = len(early.mesh().triangles)
        now = surface.snapshot()
        assert now.map_version > early.map_version > 0
        assert len(now.mesh().triangles) > triangles == len(early.mesh().triangles)
        assert pose is not None
        ahead = [pose.T_world_camera @ np.array([0, 0, z]) for z in np.arange(0.5, 4, 0.05)]
        assert (now.at(ahead)["state"] == twofold.SpaceState.FREE.value).sum() > 5
        assert now.memory_bytes() > 0 and surface.memory_bytes() > 0
        changes = surface.mesh_changes()
        assert changes.cell_size == pytest.approx(8 * 0.04)
        assert sum(len(piece.mesh.triangles) for piece in changes.pieces) >= len(now.mesh().triangles)
        assert surface.mesh_changes(changes.revision).pieces == []
        before = surface.snapshot().memory_bytes()
        surface.snapshot().prepare()
        assert surface.snapshot().memory_bytes() >= before
        here = now.camera_pose(pose)
        assert here is not None and np.abs(here.t - pose.T_world_camera.t).max() < 0.02
        assert early.camera_pose(pose) is None, "its keyframe is newer"
        in_early = early.camera_pose(pose, slam.map())
        assert in_early is not None and np.abs(in_early.t - here.t).max() < 0.05
        assert surface.snapshot(now.map_part).map_version == now.map_version
        assert surface.snapshot(12345).map_part is None
        with pytest.raises(ValueError, match="number"):
            surface.add(frame, 0)


def test_snapshots_do_not_wait_for_an_update() -> None:
    source = twofold.Source(SCENE)
    updating = threading.Event()
    done = threading.Event()
    taken = 0

    def take_snapshots(surface: twofold.MapSurface) -> None:
        nonlocal taken
        while not done.is_set():
            before = updating.is_set()
            surface.snapshot()
            taken += before and updating.is_set()

    with twofold.Slam(source.rig, mode=twofold.RunMode.DETERMINISTIC) as slam:
        surface = twofold.MapSurface(slam.map(), voxel_size=0.01)
        planner = threading.Thread(target=take_snapshots, args=(surface,))
        planner.start()
        updates = []
        for frame in source:
            slam.push(frame)
            pose = slam.latest()
            if pose is None or not pose.keyframe:
                continue
            surface.add(frame, pose.frame)
            updating.set()
            updates.append(surface.update(slam.map()))
            updating.clear()
        done.set()
        planner.join()
    assert sum(update.fused for update in updates) == len(updates)
    assert "1 fused" in repr(updates[0])
    assert taken > 20 * len(updates), "one update, one snapshot, if they took turns"


def test_the_example_runs(tmp_path: Path) -> None:
    example = Path(__file__).parents[2] / "examples" / "surface.py"
    scene = "synthetic:desk?sensor=rgbd&frames=30&width=160&height=120"
    command = [sys.executable, str(example), scene, str(tmp_path / "desk.glb")]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    assert "free ahead from" in done.stdout and "triangles written to" in done.stdout
