"""Rows on the disk: whole files only, each drive once, nothing of another campaign."""

import errno
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from canshaper.campaign.store import MOST_S, Store, parts
from canshaper.errors import CampaignError

ABOUT = {"file": "machine.yaml sha256:1", "program": "sha256:2"}


def row(seed: int, **values: Any) -> dict[str, Any]:
    return {"seed": seed, "operator": "taps", "residual_deg": 0.5 * seed, "broken": 0, **values}


def kept(folder: Path, *rows: dict[str, Any]) -> Store:
    store = Store(folder, ABOUT)
    store.add(rows)
    store.flush()
    return store


def test_rows_are_read_again_in_the_order_of_their_seeds(tmp_path: Path) -> None:
    store = kept(tmp_path / "a", row(3), row(1))
    store.add([row(2)])
    store.flush()
    again = Store(tmp_path / "a", ABOUT)
    assert again.seeds == {1, 2, 3}
    assert again.columns(["seed", "residual_deg"]) == {
        "seed": [1, 2, 3],
        "residual_deg": [0.5, 1.0, 1.5],
    }


def test_a_drive_is_kept_once(tmp_path: Path) -> None:
    kept(tmp_path, row(1), row(1))
    again = kept(tmp_path, row(1), row(2))
    assert again.columns(["seed"]) == {"seed": [1, 2]}


def test_two_campaigns_in_one_folder_lose_no_drive_and_keep_none_twice(tmp_path: Path) -> None:
    first, second = Store(tmp_path, ABOUT), Store(tmp_path, ABOUT)
    first.add([row(1), row(2)])
    first.flush()
    second.add([row(1), row(3)])
    second.flush()
    first.add([row(3), row(4)])
    first.flush()
    assert pq.read_table(tmp_path)["seed"].to_pylist() == [1, 2, 3, 4]
    assert first.seeds == {1, 2, 3, 4}


def test_what_waits_for_long_is_put_on_the_disk(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A power loss costs half a minute of work, whatever a drive takes."""
    now_s = 100.0
    monkeypatch.setattr("canshaper.campaign.store.monotonic", lambda: now_s)
    store = Store(tmp_path, ABOUT)
    store.add([row(1)])
    assert not parts(tmp_path)
    now_s += MOST_S
    store.add([row(2)])
    now_s += 1.0
    store.add([row(3)])
    assert store.columns(["seed"]) == {"seed": [1, 2]}


def test_a_measure_that_no_drive_has_yet_fits_to_those_that_have_it(tmp_path: Path) -> None:
    store = Store(tmp_path, ABOUT)
    for seed, residual in ((1, None), (2, 0.5)):
        store.add([row(seed, residual_deg=residual)])
        store.flush()
    assert store.columns()["residual_deg"] == [None, 0.5]


def test_shares_are_merged_and_what_both_have_counts_once(tmp_path: Path) -> None:
    for name, seeds in (("a", (0, 2, 4)), ("b", (1, 3, 4))):
        kept(tmp_path / name, *map(row, seeds))
    whole = Store(tmp_path / "whole", ABOUT)
    assert [whole.merge(tmp_path / name) for name in ("a", "b", "a")] == [3, 2, 0]
    assert whole.columns(["seed"]) == {"seed": [0, 1, 2, 3, 4]}


def test_drives_of_another_file_are_refused(tmp_path: Path) -> None:
    kept(tmp_path / "a", row(1))
    changed = ABOUT | {"file": "machine.yaml sha256:9"}
    text = "expected drives of file machine.yaml sha256:9, got machine.yaml sha256:1; choose"
    with pytest.raises(CampaignError, match=text):
        Store(tmp_path / "a", changed)
    with pytest.raises(CampaignError, match=text):
        Store(tmp_path / "b", changed).merge(tmp_path / "a")


def test_a_folder_without_drives_cannot_be_merged(tmp_path: Path) -> None:
    with pytest.raises(CampaignError, match="expected the Parquet files of a campaign, got none"):
        Store(tmp_path / "a", ABOUT).merge(tmp_path / "none")


def test_a_file_that_is_cut_off_is_reported(tmp_path: Path) -> None:
    kept(tmp_path, row(1))
    path = parts(tmp_path)[0]
    path.write_bytes(path.read_bytes()[:-9])
    with pytest.raises(CampaignError, match=f"{path.name}: "):
        Store(tmp_path, ABOUT)


def test_a_disk_that_is_full_leaves_what_was_written_before(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    store = kept(tmp_path, row(1))

    def full(_table: object, path: Path) -> None:
        path.write_bytes(b"PAR1 half of")
        raise OSError(errno.ENOSPC, "No space left on device")

    store.add([row(2)])
    with monkeypatch.context() as patch:
        patch.setattr(pq, "write_table", full)
        with pytest.raises(
            CampaignError, match=r"000000002.parquet: No space left on device; what"
        ):
            store.flush()
    assert [path.name for path in tmp_path.iterdir()] == ["drives-000000001.parquet"]
    store.flush()  # there is space again
    assert store.columns(["seed"]) == {"seed": [1, 2]}
