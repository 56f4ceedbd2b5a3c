"""The skeleton as a robot that Bullet reads: URDF text and files of convex hulls."""

from veca_marl.sim.body.anatomy.urdf.robot import BodyFiles, Build, body_files, bone_of

__all__ = ["BodyFiles", "Build", "body_files", "bone_of"]
