"""The colours of pictures, frames and the page (`web/page.css` has them too)."""

from keepaway_sim.task import Role

GRASS, GRASS_LIGHT, CHALK, INK, BALL = "#2c6e49", "#34794f", "#e9f3ec", "#10201a", "#ffffff"
TEAM_COLOURS = {Role.KEEPER: "#56b4e9", Role.TAKER: "#ff9e4a"}
