"""Class Slam: what libtwofold's has, and poses and events for Python's own threads."""

from __future__ import annotations

import atexit
import threading
import traceback
import weakref
from collections.abc import Callable, Iterator
from types import TracebackType
from typing import TYPE_CHECKING, Any

from . import _core
from ._core import MapEvent, PoseEstimate

# How long Python may sleep before it looks for signals [s]: Ctrl-C is answered in this time.
_SIGNAL_CHECK = 0.1


def updates_of(queue: _core.Updates) -> Iterator[PoseEstimate | MapEvent]:
    """What is put into the queue, until its end."""
    while True:
        try:
            item = queue.next(_SIGNAL_CHECK)
        except StopIteration:
            return
        if item is not None:
            yield item


def end_quietly(end: Callable[[], object]) -> None:
    """At the interpreter's end one that fails must not keep the others from ending; what it raises is printed."""
    try:
        end()
    except Exception:
        traceback.print_exc()


class _Dispatcher:
    """Calls Python functions with what comes out of a queue, on a thread of its own.

    It knows nothing of the Slam, so that one nobody refers to any more can go.
    """

    def __init__(self, queue: _core.Updates) -> None:
        self.on_pose: Callable[[PoseEstimate], object] | None = None
        self.on_event: Callable[[MapEvent], object] | None = None
        self.errors: list[str] = []
        self._queue = queue
        self._thread = threading.Thread(target=self._dispatch, name="twofold callbacks", daemon=True)
        self._thread.start()

    def join(self) -> None:
        if self._thread is not threading.current_thread():
            self._thread.join()

    def _dispatch(self) -> None:
        for item in updates_of(self._queue):
            name = "on_pose" if isinstance(item, PoseEstimate) else "on_event"
            callback: Callable[[Any], object] | None = getattr(self, name)
            if callback is None:
                continue
            try:
                callback(item)
            except Exception as error:
                what = traceback.format_exception_only(type(error), error)[-1].strip()
                self.errors.append(f"the callback of {name} raised, and is not called any more: {what}")
                setattr(self, name, None)


class Slam(_core.Slam):
    """Frames in, poses and a map out.

    with twofold.Slam(rig, live=True) as slam:
        slam.push(twofold.Frame(t_ns, left, right))
        pose = slam.latest()

    Options are those of twofold/slam.hpp, each with its default:
    mode=RunMode.THREADED      on which threads it works
    live=False                 frames are pushed when they are taken; times are of time.monotonic_ns(), the newest frame wins
    speed=0                    a recording as if it were live: recorded seconds a second; 0: as fast as the map can follow
    late=None                  LateFrames, with live or speed: what becomes of frames whose turn comes late
    map=None                   map file to go on with
    localise_only=False        poses in that map, which does not change
    initial_pose=None          InitialPose: where in that map the camera is looked for first, beside recognition
    places=True                recognise places: large loops, lost cameras, map parts
    vocabulary=None            file instead of the built-in one
    global_adjustment=True     finish() adjusts the whole map of one camera, or of a rig that has recognised a place: 1 to 2 ms a keyframe
    checkpoint=None            map file that is written again and again during the run
    checkpoint_period=60       from one to the next [s]
    schedule=None              of RunMode.REPLAY: schedule.log of the run to repeat
    inner_window=25            keyframes optimised with their points
    outer_window=175           keyframes around them, by relative poses
    frame_buffers=8            frames on their way at most
    tracker_cpu, mapper_cpu, loop_closer_cpu=None    pin the threads to these
    fifo_priority=None         SCHED_FIFO for the tracker, 1..99
    run_folder=None            folder in which trajectory_causal.txt and schedule.log grow
    kept_frames=1_000_000      without one: how many of the newest frames have a pose in Summary.trajectories
    trace=None                 file for ui.perfetto.dev, written by finish()
    ValueError and RuntimeError say what is wrong with them.

    Any thread may call any method. The interpreter's lock is released while frames are pushed and while something is waited
    for; the tracker never waits for it: poses go through a queue, from which updates(), poses() or the callbacks read.
    """

    _dispatcher: _Dispatcher | None = None
    _iterated = False

    if not TYPE_CHECKING:  # the types are those of _core.Slam

        def __init__(self, rig, **options):
            super().__init__(rig, **options)
            _open.add(self)

    def on_pose(self, callback: Callable[[PoseEstimate], object]) -> None:
        """Called for every frame that was looked at, soon after, on a thread of its own: a slow one holds up nobody, but
        loses poses (`missed`). One that raises is not called again; errors() says so. finish() waits for the last call.
        """
        self._dispatch().on_pose = callback

    def on_event(self, callback: Callable[[MapEvent], object]) -> None:
        """The same for corrections of the map; called before the pose of the frame that saw them."""
        self._dispatch().on_event = callback

    def updates(self) -> Iterator[PoseEstimate | MapEvent]:
        """Poses and corrections of the map as they arise, until finish(); for one reader."""
        if self._dispatcher is not None:
            raise RuntimeError("the callbacks get the poses: there is one reader")
        self._iterated = True
        return updates_of(self._updates)

    def poses(self) -> Iterator[PoseEstimate]:
        """The poses of updates() alone."""
        return (item for item in self.updates() if isinstance(item, PoseEstimate))

    def missed(self) -> int:
        """How many updates were lost since the last call, because 512 or more waited to be read."""
        return self._updates.take_missed()

    def errors(self) -> list[str]:
        """What went wrong so far; tracking goes on unless it says otherwise."""
        own = [] if self._dispatcher is None else self._dispatcher.errors
        return [*super().errors(), *own]

    def finish(self) -> _core.Summary:
        """Tracks what is queued, with `speed` when its time has come (end_pace), makes all poses agree globally and ends the
        threads. A second call: the same answer.
        """
        summary = super().finish()
        if self._dispatcher is not None:
            self._dispatcher.join()
        summary.errors = self.errors()
        return summary

    def __enter__(self) -> Slam:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        if kind is not None:  # as Ctrl-C: nobody waits for the rest
            self.end_pace()
        self.finish()

    def _dispatch(self) -> _Dispatcher:
        if self._iterated:
            raise RuntimeError("updates() or poses() gets the poses: there is one reader")
        if self._dispatcher is None:
            self._dispatcher = _Dispatcher(self._updates)
        return self._dispatcher


_open: weakref.WeakSet[Slam] = weakref.WeakSet()


@atexit.register
def _finish_all() -> None:
    # A thread that comes back from libtwofold after the interpreter's end would bring the process down.
    for slam in list(_open):
        end_quietly(slam.end_pace)
        end_quietly(slam.finish)
        end_quietly(slam.close_view)
