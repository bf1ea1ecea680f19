"""Whether a grasp can be compared with those that a store has: the same settings, and the same gripper.

Trials that are learned from together must have been recorded alike. A grasp that differs from the newest one of its
store is therefore refused, unless the user wants the change.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Final

from graspsense.core.components.caller import option
from graspsense.core.components.setting import CHANGES_NO_RESULT, settings_marked
from graspsense.core.settings.resolved import Settings
from graspsense.core.values.device import DeviceInfo
from graspsense.core.values.errors import ConfigError
from graspsense.recording.provenance import recipe
from graspsense.recording.trial_record import DeviceRecord, without_none
from graspsense.store.rows import StoredTrial
from graspsense.store.store import Store

_COMPARED: Final = ("name", "serial", "calibration")


def newest_grasp(store: Store) -> StoredTrial | None:
    """Return the newest trial that was grasped into this store and is not set aside, None if there is none.

    Imported trials have other grippers, and are not compared.
    """
    newest = [trial for origin in ("run", "collect") for trial in store.page(origin=origin, limit=1)]
    return store.trial(max(trial.id for trial in newest)) if newest else None


def check_settings(store: Store, stored: StoredTrial, settings: Settings) -> None:
    """Raise ConfigError that lists what differs if these settings are not those of a stored trial.

    What is grasped, the seed, the classifier, and settings that change no result may differ.
    """
    now, then = recipe(without_none(settings.values)), stored.recipe
    differences = []
    configs = {part.component.table: part.config for part in settings.chosen} | {"run": settings.run}
    for table in dict.fromkeys((*then, *now)):
        was, is_now = then.get(table, {}), now.get(table, {})
        if was.get("type") != is_now.get("type"):
            differences.append(_difference(f"{table}.type", was.get("type"), is_now.get("type")))
            continue
        declared = settings.keys(table)
        passive = settings_marked(type(configs[table]), CHANGES_NO_RESULT) if table in configs else ()
        for key in dict.fromkeys((*was, *is_now)):
            # A key that the trial does not have is newer than the trial, which was recorded with its default.
            default = without_none(declared[key]["default"]) if key in declared else None
            before_value, value = was.get(key, default), is_now.get(key, default)
            if before_value != value and key not in passive:
                differences.append(_difference(f"{table}.{key}", before_value, value))
    if differences:
        raise ConfigError(_refusal("settings", store, stored, differences))


def check_device(store: Store, stored: StoredTrial, device: DeviceInfo) -> None:
    """Raise ConfigError that lists what differs if this gripper is not that of a stored trial."""
    then, now = stored.record.device, DeviceRecord.described(device)
    differences = [
        _difference(name, getattr(then, name), getattr(now, name))
        for name in _COMPARED
        if getattr(then, name) != getattr(now, name)
    ]
    if differences:
        raise ConfigError(_refusal("gripper", store, stored, differences))


def _difference(name: str, was: Any, is_now: Any) -> str:
    return f"{name} was {_shown(was)} and is {_shown(is_now)}"


def _shown(value: Any) -> str:
    return "not set" if value is None else repr(value)


def _refusal(what: str, store: Store, stored: StoredTrial, differences: Sequence[str]) -> str:
    lines = "".join(f"\n  {line}" for line in differences)
    return (
        f"the {what} differ from trial {stored.summary.id} of the store in {store.folder}:{lines}\n"
        f"  Restore them, use another store, or add {option('changed', python='changed=True')} if this is intended"
    )
