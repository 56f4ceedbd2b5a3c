"""Tasks of a sitting body with objects: grasping, moving, rotating, piling up, putting down."""
