"""One file per engine: `patches(scene, substeps)` and `hanging(scene, substeps)`.

Both give an object with `step(targets)` (targets of the next frame, or None), which returns the
time that the engine took for the frame as a `clock.Clock`, and `positions()` in metres.
"""
