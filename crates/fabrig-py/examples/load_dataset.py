"""Reads a dataset that `fabrig batch` made (docs/batch.md), with NumPy alone.

    python load_dataset.py out

`FaceDataset` has a length and gives frames by their number, which is all that a PyTorch
`DataLoader` asks for.
"""

import json
import pathlib
import sys

import numpy as np


class FaceDataset:
    """Frames of all pairs, one after the other."""

    def __init__(self, folder):
        self.folder = pathlib.Path(folder)
        listed = json.loads((self.folder / "dataset.json").read_text())
        if listed["schema"] != "fabrig-dataset 1":
            raise ValueError(f"{folder}: this reads 'fabrig-dataset 1', not '{listed['schema']}'")
        self.pairs = listed["pairs"]
        # What all takes of a face share: a few hundred kilobytes each.
        self.faces = {face["face"]: self._load(face["file"]) for face in listed["faces"]}
        self._ends = np.cumsum([pair["frames"] for pair in self.pairs])
        self._at = None, {}

    def _load(self, file):
        with np.load(self.folder / file) as archive:
            return {name: archive[name] for name in archive.files}

    def __len__(self):
        return int(self._ends[-1]) if self.pairs else 0

    def __getitem__(self, index):
        """Face, displacements from its rest (mm), weights of the shapes."""
        if not 0 <= index < len(self):
            raise IndexError(index)
        number = int(np.searchsorted(self._ends, index, side="right"))
        pair = self.pairs[number]
        if self._at[0] != number:
            self._at = number, self._load(pair["file"])
        arrays = self._at[1]
        frame = index - int(self._ends[number]) + pair["frames"]
        moved = arrays["positions"][frame] - self.faces[pair["face"]]["rest"]
        return pair["face"], moved, arrays["weights"][frame]


def main():
    data = FaceDataset(sys.argv[1])
    print(f"{len(data.faces)} faces, {len(data.pairs)} takes on them, {len(data)} frames")
    largest = {}
    for index in range(len(data)):
        face, moved, _ = data[index]
        length = float(np.linalg.norm(moved, axis=1).max())
        largest[face] = max(largest.get(face, 0.0), length)
    for face, length in largest.items():
        triangles = len(data.faces[face]["triangles"])
        print(f"{face}: {triangles} triangles, skin moves by up to {length:.1f} mm")


if __name__ == "__main__":
    main()
