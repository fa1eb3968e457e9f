"""The keepaway world: physics, vision, skills and referee for any number of fields."""
