"""What tests of Bullet's functions share."""

import pytest

from veca_marl.sim.physics.bullet_client import BulletClient


@pytest.fixture
def client():
    client = BulletClient()
    yield client
    client.close()
