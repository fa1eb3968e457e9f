"""The keeper's node; see `player`."""

from keepaway_agent.actions import Role
from keepaway_agent.nodes import player


def main(args: list[str] | None = None) -> None:
    """Run one keeper."""
    player.main(Role.KEEPER, args)


if __name__ == "__main__":
    main()
