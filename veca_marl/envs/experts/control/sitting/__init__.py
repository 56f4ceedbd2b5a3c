"""The upper body of a sitting child: balance, and inverse kinematics of the arms."""
