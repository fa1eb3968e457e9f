"""The soccer server's world: physics, referee, perception and skills of many fields."""
