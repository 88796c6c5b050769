"""Time of one frame, on the wall and on all processors together."""

import time


class Clock:
    """Adds up the stretches it is entered for."""

    def __init__(self):
        self.wall_ms = self.cpu_ms = 0.0

    def __enter__(self):
        self.wall, self.cpu = time.perf_counter(), time.process_time()
        return self

    def __exit__(self, *_):
        self.wall_ms += (time.perf_counter() - self.wall) * 1e3
        self.cpu_ms += (time.process_time() - self.cpu) * 1e3
