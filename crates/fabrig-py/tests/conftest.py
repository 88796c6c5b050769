import fabrig
import pytest


@pytest.fixture(scope="session")
def face():
    return fabrig.demo_face()


@pytest.fixture(scope="session")
def rig(face):
    return fabrig.rig(face.vertices, face.faces)
