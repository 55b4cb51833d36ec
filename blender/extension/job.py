"""Work in another thread, and steps that wait for it. Knows nothing of Blender, whose data may be touched in the main thread only."""

from __future__ import annotations

import threading
import time

import impinge

__all__ = ["Driver", "Job"]

#: Seconds to wait for a job that may be short.
SHORT = 0.005


class Job:
    """Runs `work(cancel, progress)` in a thread of its own. `progress` takes how much is done, and of how much."""

    def __init__(self, work):
        self._cancel = impinge.CancelToken()
        self._result = self._error = None
        self.progress = (0, 0)
        self._thread = threading.Thread(target=self._run, args=(work,), daemon=True)
        self._thread.start()

    def _run(self, work):
        try:
            self._result = work(self._cancel, self._tell)
        except BaseException as error:  # noqa: BLE001: it is raised in the thread that asks for the result.
            self._error = error

    def _tell(self, done, total):
        self.progress = (done, total)

    @property
    def is_done(self):
        return not self._thread.is_alive()

    def wait(self, seconds=None):
        self._thread.join(seconds)

    def cancel(self):
        """The work ends soon, by `impinge.Cancelled`, unless it is done first."""
        self._cancel.cancel()

    def result(self):
        """What the work has returned, or its exception raised."""
        self.wait()
        if self._error is not None:
            error, self._error = self._error, None
            if isinstance(error, MemoryError):
                # Its frames hold the arrays for which there was no more room.
                error = error.with_traceback(None)
            raise error
        return self._result


class Driver:
    """Moves a generator on, which yields jobs and is sent their results, step by step, so that an interface has time between the steps. A job
    that fails, or is cancelled, raises in the generator, and from `poll` what the generator lets through.
    """

    def __init__(self, steps):
        self._steps = steps
        self._job = None
        self._is_cancelled = False
        self.value = None

    @property
    def progress(self):
        return (0, 0) if self._job is None else self._job.progress

    def poll(self, seconds=0.0):
        """Whether the generator has returned; `value` then has what. One step, and while jobs are short, more of them for this long."""
        end = time.perf_counter() + seconds
        while not self._step():
            if time.perf_counter() >= end:
                return False
            self._job.wait(SHORT)
            if not self._job.is_done:
                return False
        return True

    def _step(self):
        if self._job is not None and not self._job.is_done:
            return False
        try:
            if self._is_cancelled:
                self._job = self._steps.throw(impinge.Cancelled("cancelled"))
            elif self._job is None:
                self._job = next(self._steps)
            else:
                job = self._job
                try:
                    result = job.result()
                except Exception as error:  # noqa: BLE001: for the generator to heed.
                    self._job = self._steps.throw(error)
                else:
                    self._job = self._steps.send(result)
        except StopIteration as stop:
            self.value = stop.value
            return True
        return False

    def run(self):
        """Waits until the generator has returned, and returns what it has."""
        while not self._step():
            self._job.wait()
        return self.value

    def cancel(self):
        """Stops the work. The next `poll` after it has stopped raises `impinge.Cancelled` in the generator."""
        self._is_cancelled = True
        if self._job is not None:
            self._job.cancel()
