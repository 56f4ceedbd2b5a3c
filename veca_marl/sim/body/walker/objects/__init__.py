"""What a walker does with props: hold one in the hand, and kick."""
