"""The scripts for recordings as a person runs them."""

import subprocess
import sys
from pathlib import Path

import layouts
import pytest

from keepaway_sim.bags.reader import BagReader
from keepaway_sim.wire.cdr import codec

ROOT = Path(__file__).resolve().parents[2]


def run(script: str, *arguments: object) -> "subprocess.CompletedProcess[str]":
    command = [sys.executable, str(ROOT / "scripts" / f"{script}.py"), *map(str, arguments)]
    return subprocess.run(command, capture_output=True, text=True, timeout=900)


@pytest.fixture(scope="module")
def cut_off(bag_3v2: Path, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A bag whose writer was killed: its file has no end, and nothing else was written."""
    folder = tmp_path_factory.mktemp("cut") / "bag"
    folder.mkdir()
    data = next(bag_3v2.glob("*.mcap")).read_bytes()
    (folder / "bag_0.mcap").write_bytes(data[: len(data) * 9 // 10])
    return folder


def test_repair_bag_makes_a_whole_one_and_leaves_the_other(cut_off: Path) -> None:
    before = (cut_off / "bag_0.mcap").read_bytes()
    told = run("repair_bag", cut_off)
    assert told.returncode == 0, told.stderr
    whole = BagReader(cut_off.with_name("bag_repaired"))
    assert whole.complete
    assert f"{whole.message_count} messages\n" in told.stdout
    assert (cut_off / "bag_0.mcap").read_bytes() == before
    again = run("repair_bag", cut_off)
    assert again.returncode == 1
    assert "exists already" in again.stderr


def test_a_whole_bag_needs_no_repair(bag_3v2: Path) -> None:
    told = run("repair_bag", bag_3v2)
    assert (told.returncode, told.stdout) == (0, f"{bag_3v2} is whole: nothing to repair\n")


def test_view_writes_the_page_or_a_picture(bag_3v2: Path, tmp_path: Path) -> None:
    page = run("view", bag_3v2, "--episodes", "1-2", "--out", tmp_path / "match.html")
    assert page.returncode == 0, page.stderr
    assert (tmp_path / "match.html").read_text().startswith("<!doctype html>")
    options = ("--episodes", 2, "--time", 1.5, "--player", "keeper_2")
    picture = run("view", bag_3v2, "--picture", tmp_path / "moment.png", *options)
    assert picture.stdout == f"{tmp_path / 'moment.png'}: episode 2 at 1.5 s\n"


@pytest.mark.parametrize(
    ("script", "arguments", "complaint"),
    [
        ("view", ["nowhere"], "nowhere: no bag there"),
        ("repair_bag", ["nowhere"], "nowhere: no bag there"),
        ("replay", ["nowhere", "--check"], "nowhere: no bag there"),
        ("view", [], "name a bag, or --live"),
    ],
)
def test_refusals_are_one_line(script: str, arguments: list[str], complaint: str) -> None:
    told = run(script, *arguments)
    assert told.returncode in (1, 2)
    assert complaint in told.stderr
    assert "Traceback" not in told.stderr


def test_a_picture_is_of_the_first_episode_that_is_there(bag_3v2: Path, tmp_path: Path) -> None:
    later = [s for s in layouts.read(bag_3v2) if not is_first(s)]
    bag = layouts.write(tmp_path / "later.mcap", later)
    told = run("view", bag, "--picture", tmp_path / "first.png")
    assert told.stdout == f"{tmp_path / 'first.png'}: episode 1 at 0.0 s\n", told.stderr
    told = run("view", bag, "--picture", tmp_path / "none.png", "--episodes", "0")
    assert (told.returncode, told.stderr) == (1, f"view: episode 0 is not in {bag}: it has 1..3\n")


def is_first(said: layouts.Said) -> bool:
    """Whether it is a clock, or about the episode with number 0."""
    if said.topic in ("/clock", "/match"):
        return said.topic == "/clock"
    values = codec(said.message_type).decode(said.data)
    return values.get("number" if said.topic == "/episode" else "episode") == 0


def test_a_picture_of_nobodys_belief_is_refused(bag_3v2: Path, tmp_path: Path) -> None:
    told = run("view", bag_3v2, "--picture", tmp_path / "moment.png", "--player", "goalie")
    assert (told.returncode, told.stdout) == (1, "")
    assert "player 'goalie': the match has keeper_1" in told.stderr


def test_check_says_that_a_match_replays_or_why_it_cannot(bag_3v2: Path) -> None:
    told = run("replay", bag_3v2, "--check")
    assert told.returncode == 1
    assert "does not say who played" in told.stderr


def test_analyze_knows_a_bag(bag_3v2: Path, tmp_path: Path) -> None:
    told = run("analyze", bag_3v2, "--out", tmp_path / "report")
    assert told.returncode == 0, told.stderr
    assert told.stdout.startswith("3v2: 4 episodes in")
    assert (tmp_path / "report" / "episodes.csv").is_file()


def test_analysing_a_bag_imports_no_statistics_and_no_pandas(bag_3v2: Path, tmp_path: Path) -> None:
    """They take seconds and 100 MB, and even a file that is refused may take 5 s at most."""
    words = [str(ROOT / "scripts/analyze.py"), str(bag_3v2), "--out", str(tmp_path / "report")]
    script = (
        f"import runpy, sys; sys.argv = {words!r}\n"
        "try: runpy.run_path(sys.argv[0], run_name='__main__')\n"
        "except SystemExit as end: print(end.code, {'pandas', 'statsmodels'} & {*sys.modules})"
    )
    told = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True)
    assert told.stdout.splitlines()[-1] == "0 set()", told.stderr
