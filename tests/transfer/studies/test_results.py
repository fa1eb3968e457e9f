"""Results land trial by trial, survive a kill, and are never mixed or overwritten."""

import dataclasses
import fcntl
import multiprocessing

import attrs
import pytest

from keepaway_transfer.errors import StudyError
from keepaway_transfer.studies.records import block_of, read_records
from keepaway_transfer.studies.results import (
    SourceRun,
    StudyTrial,
    open_results,
    pack,
    read_results,
    read_trials,
    record_of,
)
from keepaway_transfer.studies.study import load_study

STUDY = load_study("tiny")


def trial(number, row="4"):
    source = SourceRun("2v1", 4, 321, keeper=1)
    return StudyTrial(row, number, (source,), (12, 34), (56,), "0.1.0+gabc")


def opened(folder, study=STUDY, code_version="0.1.0+gabc", **options):
    return open_results(
        folder, study, command="scripts/study.py tiny", code_version=code_version, **options
    )


def append(folder, *numbers, **options):
    with opened(folder, **options) as results:
        for number in numbers:
            results.append(trial(number))


def test_what_was_appended_is_read_with_its_study_and_command(tmp_path):
    append(tmp_path, 0, 1)
    results = read_results(tmp_path)
    assert tuple(read_trials(tmp_path)) == (trial(0), trial(1))
    assert results.records == (record_of(trial(0), STUDY), record_of(trial(1), STUDY))
    assert results.study == STUDY
    assert results.command == "scripts/study.py tiny"


def test_going_on_knows_what_is_done(tmp_path):
    append(tmp_path, 0, 1)
    with opened(tmp_path, resume=True) as results:
        assert results.done == {("4", 0), ("4", 1)}


def test_a_trial_is_on_disk_before_the_next_one(tmp_path):
    with opened(tmp_path) as results:
        results.append(trial(0))
        assert len(read_results(tmp_path).records) == 1


def test_half_a_line_of_a_killed_writer_is_cut_off(tmp_path):
    append(tmp_path, 0)
    with open(tmp_path / "trials.jsonl", "a") as file:
        file.write('{"row":"4","num')
    assert len(read_results(tmp_path).records) == 1
    append(tmp_path, 1, resume=True)
    assert tuple(read_trials(tmp_path)) == (trial(0), trial(1))


def test_results_are_not_touched_without_resume(tmp_path):
    append(tmp_path, 0)
    with pytest.raises(StudyError, match="add --resume to continue, or name another folder"):
        append(tmp_path, 1)
    assert len(read_results(tmp_path).records) == 1


def test_a_changed_setting_is_refused_by_name(tmp_path):
    append(tmp_path, 0)
    changed = attrs.evolve(STUDY, threshold=6.0)
    with pytest.raises(StudyError, match=r"Changed: threshold: 5\.0 -> 6\.0"):
        append(tmp_path, 1, study=changed, resume=True)


def test_other_code_is_refused_unless_it_is_said_not_to_matter(tmp_path):
    append(tmp_path, 0)
    with pytest.raises(StudyError, match=r"begun with code 0\.1\.0\+gabc, this is 0\.1\.0\+gdef"):
        append(tmp_path, 1, resume=True, code_version="0.1.0+gdef")
    append(tmp_path, 1, resume=True, code_version="0.1.0+gdef", any_code=True)
    assert len(read_results(tmp_path).records) == 2


def test_more_trials_are_no_changed_setting(tmp_path):
    append(tmp_path, 0)
    append(tmp_path, 1, study=attrs.evolve(STUDY, trials=9), resume=True)
    assert len(read_results(tmp_path).records) == 2


def _try_to_open(folder, answers):
    try:
        append(folder, 1, resume=True)
    except StudyError as error:
        answers.put(str(error))


def test_a_second_writer_is_refused(tmp_path):
    answers = multiprocessing.get_context("spawn").Queue()
    with opened(tmp_path):
        other = multiprocessing.get_context("spawn").Process(
            target=_try_to_open, args=(tmp_path, answers)
        )
        other.start()
        assert "another process is writing" in answers.get(timeout=900)
        other.join()


def test_packed_trials_are_read_without_the_others(tmp_path):
    append(tmp_path, 0, 1)
    before = read_results(tmp_path)
    pack(tmp_path)
    (tmp_path / "trials.jsonl").unlink()
    assert read_results(tmp_path) == before


def test_a_study_goes_on_where_its_packed_trials_end(tmp_path):
    append(tmp_path, 0, 1)
    pack(tmp_path)
    (tmp_path / "trials.jsonl").unlink()
    with opened(tmp_path, resume=True) as results:
        assert results.done == {("4", 0), ("4", 1)}
        results.append(trial(2))
    pack(tmp_path)
    assert [record.number for record in read_results(tmp_path).records] == [0, 1, 2]
    assert [record.number for record in read_records(tmp_path / "trials.parquet")] == [0, 1, 2]


def test_trials_of_other_results_are_taken_over_beside_those_that_are_there(tmp_path):
    append(tmp_path, 0)
    mine, other = record_of(trial(0), STUDY), record_of(trial(1), STUDY)
    with opened(tmp_path, resume=True) as results:
        results.take_over([dataclasses.replace(mine, code_version="another"), other])
        assert results.done == {("4", 0), ("4", 1)}
        results.append(trial(2))
    pack(tmp_path)
    assert read_results(tmp_path).records == (mine, other, record_of(trial(2), STUDY))


def test_results_packed_into_another_folder_are_results(tmp_path):
    append(tmp_path / "run", 0, 1)
    pack(tmp_path / "run", tmp_path / "published")
    assert read_results(tmp_path / "published") == read_results(tmp_path / "run")
    assert {path.name for path in (tmp_path / "published").iterdir()} == {
        "study.json",
        "trials.parquet",
    }


def test_packing_again_gives_the_same_bytes(tmp_path):
    append(tmp_path, 1, 0)
    first = pack(tmp_path).read_bytes()
    assert pack(tmp_path).read_bytes() == first


def test_a_record_keeps_blocks_and_the_first_and_last_episodes(tmp_path):
    study = attrs.evolve(STUDY, window=1000, threshold=9.0)
    cycles = tuple(range(10, 2000))
    record = record_of(StudyTrial("0", 0, (), cycles, (50, 70), "v1"), study)
    assert (record.block, len(record.blocks)) == (
        50,
        39,
    )  # 1,990 episodes: the last 40 are no block
    assert record.blocks[1] == sum(range(60, 110))
    assert (record.first, record.last) == (cycles[:100], cycles[-100:])
    assert record.initial == pytest.approx(5.95)
    assert record.greedy == pytest.approx(6.0)
    assert record.crossing_episodes == 1000  # the first window has a mean of 50.95 s


@pytest.mark.parametrize("window", [1, 2, 5, 19, 20, 70, 200, 1000])
def test_a_window_is_a_whole_number_of_blocks(window):
    assert window % block_of(window) == 0


def test_a_file_that_is_no_packed_trials_is_refused_with_its_path(tmp_path):
    append(tmp_path, 0)
    (tmp_path / "trials.parquet").write_bytes(b"PAR1 and nothing more")
    with pytest.raises(StudyError, match=r"trials\.parquet: not a Parquet file"):
        read_results(tmp_path)


def _begin(folder, threshold, barrier, answers):
    barrier.wait()
    try:
        with opened(folder, study=attrs.evolve(STUDY, threshold=threshold)) as results:
            answers.put(threshold)
            results.append(trial(0))
            barrier.wait()  # until the other one was refused
    except StudyError as error:
        answers.put(str(error))
        barrier.wait()


def test_of_two_studies_that_begin_one_folder_at_once_one_is_refused(tmp_path):
    context = multiprocessing.get_context("spawn")
    barrier, answers = context.Barrier(2), context.Queue()
    others = [
        context.Process(target=_begin, args=(tmp_path / "out", threshold, barrier, answers))
        for threshold in (5.5, 6.5)
    ]
    for other in others:
        other.start()
    said = [answers.get(timeout=900) for _ in others]
    for other in others:
        other.join()
    (began,) = (each for each in said if isinstance(each, float))
    assert any("another process" in str(each) or "has results" in str(each) for each in said)
    results = read_results(tmp_path / "out")
    assert results.study.threshold == began
    assert results.records == (record_of(trial(0), results.study),)


def test_a_file_system_without_locks_is_said_and_used(tmp_path, monkeypatch, caplog):
    def flock(*_):
        raise OSError(37, "No locks available")

    monkeypatch.setattr(fcntl, "flock", flock)
    append(tmp_path, 0)
    assert "cannot be locked" in caplog.text
    assert tuple(read_trials(tmp_path)) == (trial(0),)


def test_a_folder_without_results_is_refused(tmp_path):
    with pytest.raises(StudyError, match=r"holds no results: it has no study\.json"):
        read_results(tmp_path)


@pytest.mark.parametrize("line", [b"{}\n", b"\x80\n", b"\xff\xfe{\x00}\x00\n", b"[" * 9999 + b"\n"])
def test_a_line_that_is_no_trial_is_refused_with_its_number(line, tmp_path):
    append(tmp_path, 0)
    with open(tmp_path / "trials.jsonl", "ab") as file:
        file.write(line)
    with pytest.raises(StudyError, match="trial on line 2"):
        read_results(tmp_path)
