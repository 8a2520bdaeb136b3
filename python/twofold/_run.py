"""A source and a Slam, tied together."""

from __future__ import annotations

import atexit
import threading
import weakref
from collections.abc import Iterator
from os import PathLike
from types import TracebackType
from typing import Any

from . import _core
from ._core import MapEvent, PoseEstimate, RunMode, Source, Summary
from ._slam import Slam, end_quietly, updates_of


class _Feeder:
    """Pushes a source's frames on a thread of its own, which needs no interpreter, and finishes."""

    def __init__(self, source: Source, slam: Slam) -> None:
        self.error: Exception | None = None
        self._thread = threading.Thread(target=self._feed, args=(source, slam), name="twofold feeder", daemon=True)
        self._thread.start()

    def join(self) -> None:
        self._thread.join()

    def _feed(self, source: Source, slam: Slam) -> None:
        try:
            _core.feed(source, slam)
        except Exception as error:
            self.error = error
        finally:
            slam.finish()


class Run:
    """Poses of a source, one after the other:

    for pose in twofold.run(source):
        ...

    Iterating starts the run. A recording waits for whoever iterates; a camera does not, and poses that nobody takes in time
    are lost (run.slam.missed()). Leaving the loop early, Ctrl-C included, ends the run when the last reference goes; used as
    a context manager, it ends with the block.
    """

    def __init__(self, source: str | PathLike[str] | Source, **options: Any) -> None:
        self.source = source if isinstance(source, Source) else Source(source)
        mode = options.get("mode", RunMode.THREADED)
        if mode == RunMode.STEPPED:
            raise ValueError("run() takes no steps: RunMode.STEPPED is for a Slam of your own")
        if mode == RunMode.THREADED:
            options.setdefault("live", self.source.is_live)
        self.slam = Slam(self.source.rig, **options)
        self._feeder: _Feeder | None = None
        self._updates: Iterator[PoseEstimate | MapEvent] | None = None
        _open.add(self)

    def updates(self) -> Iterator[PoseEstimate | MapEvent]:
        """Poses, and corrections of the map before the poses that saw them. Raises what the source raises, at the end."""
        if self._feeder is None:
            self._feeder = _Feeder(self.source, self.slam)
            self._updates = updates_of(self.slam._updates)
        assert self._updates is not None
        yield from self._updates
        self._feeder.join()
        if self._feeder.error is not None:
            raise self._feeder.error

    def __iter__(self) -> Iterator[PoseEstimate]:
        return (item for item in self.updates() if isinstance(item, PoseEstimate))

    def finish(self) -> Summary:
        """Ends the run, wherever it is, and says what it came to."""
        self.source.stop()
        self.slam._updates.close()
        self.slam.end_pace()
        if self._feeder is not None:
            self._feeder.join()
        return self.slam.finish()

    def __enter__(self) -> Run:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.finish()

    def __del__(self) -> None:
        if hasattr(self, "_feeder"):
            self.finish()


def run(source: str | PathLike[str] | Source, **options: Any) -> Run:
    """Tracks a source, given as on the command line or opened before. Options are those of Slam; `live` follows the source."""
    return Run(source, **options)


_open: weakref.WeakSet[Run] = weakref.WeakSet()


@atexit.register
def _finish_all() -> None:
    # Before Slam's own, which was registered earlier: a feeder must not wait for a reader that is gone.
    for open_run in list(_open):
        end_quietly(open_run.finish)
