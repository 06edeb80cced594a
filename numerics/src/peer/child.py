"""Runs `diffmoments` for another process: a line of JSON for each request and each answer.

Arrays come and go as files of plain numbers. Times are those of the extension's own functions on
arrays that are there already, without allocation and without the Python around them: processor
time of this process, which on its one core nothing else on the machine adds to.
"""

import json
import os
import sys
import time

# Libraries print where they like; answers have a stream of their own.
answers = os.fdopen(os.dup(1), "w", encoding="utf-8")
os.dup2(2, 1)


def answer(**fields):
    answers.write(json.dumps(fields) + "\n")
    answers.flush()


cpu = None
if hasattr(os, "sched_setaffinity"):
    # One core, before any library counts them: whatever threads there are share it.
    cpu = max(os.sched_getaffinity(0))
    os.sched_setaffinity(0, {cpu})

try:
    import numpy as np
    import diffmoments_ext as dmx
except ImportError as error:
    answer(missing=error.name or str(error))
    sys.exit(0)

try:
    from importlib.metadata import version

    answer(version=version("diffmoments"), numpy=np.__version__, cpu=cpu)
except ImportError:
    answer(version="", numpy=np.__version__, cpu=cpu)

SUFFIX = {4: ("f32", np.float32), 8: ("f64", np.float64)}


class Rows:
    """Input, and results of the latest call of each kind."""

    def __init__(self, request):
        suffix, dtype = SUFFIX[request["bytes"]]
        moments, rows = 2 * request["n"] + 1, request["rows"]
        data = np.fromfile(request["path"], dtype)
        self.moments = np.ascontiguousarray(data[: moments * rows].reshape(moments, rows))
        self.eta, self.d_bound = data[moments * rows :].reshape(2, rows).copy()
        self.bounds = np.zeros(rows, dtype)
        self.d_moments = np.zeros_like(self.moments)
        self.d_eta = np.zeros_like(self.eta)
        self.bias = request["bias"]
        self.overestimation = request["overestimation"]
        self.forward = getattr(dmx, "compute_moment_bounds_" + suffix)
        self.backward = getattr(dmx, "compute_moment_bounds_backward_" + suffix)
        size = getattr(dmx, "get_required_backward_storage_size_" + suffix)
        self.flags = {False: 0, True: dmx.ComputeMomentBoundsFlags.RetainRoots}
        self.storage = {
            retain: np.zeros(size(self.moments, flags), dtype)
            for retain, flags in self.flags.items()
        }
        self.stored = {False: False, True: False}

    def time(self, gradient, retain):
        storage, flags = self.storage[retain], self.flags[retain]
        if gradient and not self.stored[retain]:
            self.time(False, retain)
        start = time.process_time()
        if gradient:
            self.backward(
                self.moments, self.eta, self.bounds, storage, self.d_moments, self.d_eta,
                self.d_bound, self.bias, self.overestimation, flags,
            )
        else:
            self.forward(
                self.moments, self.eta, self.bounds, storage, self.bias, self.overestimation, flags
            )
        seconds = time.process_time() - start
        self.stored[retain] = True
        return seconds

    def canonical(self, path):
        """Writes the points of the canonical representation, n + 1 columns, then their weights."""
        suffix, dtype = SUFFIX[self.moments.dtype.itemsize]
        count = (self.moments.shape[0] + 1) // 2
        points = np.zeros((count, self.moments.shape[1]), dtype)
        weights = np.zeros_like(points)
        getattr(dmx, "compute_moment_bounds_and_roots_" + suffix)(
            self.moments, self.eta, self.bounds, points, weights, self.bias, self.overestimation
        )
        with open(path, "wb") as file:
            points.tofile(file)
            weights.tofile(file)


rows = None
for line in sys.stdin:
    request = json.loads(line)
    try:
        if request["do"] == "load":
            rows = None
            rows = Rows(request)
            answer()
        elif request["do"] == "time":
            answer(seconds=rows.time(request["gradient"], request["retain"]))
        elif request["do"] == "bounds":
            rows.bounds.tofile(request["path"])
            answer()
        elif request["do"] == "overestimate":
            rows.overestimation = request["weight"]
            rows.stored = {False: False, True: False}
            answer()
        elif request["do"] == "canonical":
            rows.canonical(request["path"])
            answer()
        elif request["do"] == "gradients":
            with open(request["path"], "wb") as file:
                rows.d_moments.tofile(file)
                rows.d_eta.tofile(file)
            answer()
    except Exception as error:  # whatever it is, the other process must hear of it
        answer(error=f"{type(error).__name__}: {error}")
