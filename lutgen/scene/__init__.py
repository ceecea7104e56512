"""What render and viewer show alike: a look, its light and surroundings, a head with its maps, the display."""
