"""The animation of a walker: gait, stances, poses of the bones, and the sound of its steps."""
