"""Validation of hand-written files: unknown keys are errors, and an error is one clause.

The models that derive from `Strict` define the keys: vehicle, mapping, model and database file.
"""

from collections.abc import Mapping, Sequence
from typing import Any, TypeVar

from pydantic import BaseModel, ConfigDict, ValidationError

from aerodb.errors import AeroError, InputError, nearest, together
from aerodb.support.toml import parsed_toml

Model = TypeVar("Model", bound=BaseModel)


class Strict(BaseModel):
    """Base of file models: frozen; unknown keys are errors."""

    model_config = ConfigDict(frozen=True, extra="forbid", defer_build=True)


def validated_toml(model: type[Model], text: str, where: str) -> Model:
    """Return a TOML text as a `model`.

    Raises InputError as `parsed_toml` and `validated` do.
    """
    return validated(model, parsed_toml(text, where), where)


def validated(model: type[Model], data: Any, where: str) -> Model:
    """Return `data` as a `model`.

    Raises InputError for all errors, each with its key and, for an unknown key, the nearest one.
    """
    try:
        return model.model_validate(data)
    except InputError as error:
        raise InputError(error.what, where, error.remedy) from error
    except ValidationError as error:
        faults = error.errors()
    # A mistyped required key is both unknown and missing; report it as unknown, because then the
    # nearest known key can be named.
    if any(each["type"] == "extra_forbidden" for each in faults):
        faults = [each for each in faults if each["type"] != "missing"]
        faults.sort(key=lambda each: each["type"] != "extra_forbidden")
    places = [each["loc"] for each in faults]
    faults = [each for each in faults if each["type"] != "too_short" or not _inside(each, places)]
    told: dict[str, InputError] = {}  # a choice of types fails once for each of them
    for fault in faults:
        told.setdefault(_key_of_error(data, fault["loc"], fault["type"]), _told(model, data, fault))
    said = together([*told.values()])
    raise InputError(said.what, where, said.remedy)


def _inside(fault: Any, places: Sequence[tuple[int | str, ...]]) -> bool:
    """Whether a place is inside that of a fault: a list is too short without its faulty items."""
    whole = fault["loc"]
    return any(len(place) > len(whole) and place[: len(whole)] == whole for place in places)


def _told(model: type[Model], data: Any, fault: Any) -> InputError:
    """An error of the validation as one clause."""
    path = _key_of_error(data, fault["loc"], fault["type"])
    if fault["type"] == "extra_forbidden":
        known = _known_keys(model, fault["loc"][:-1])
        return InputError(f"unknown key '{path}'", remedy=nearest(str(fault["loc"][-1]), known))
    if fault["type"] == "missing":
        last = fault["loc"][-1]
        if isinstance(last, str):
            return InputError(f"{path} is missing", remedy=f"write {last} = ...")
        of = path.rpartition(".")[0]
        what = f"{of} has {last} value{'s' * (last != 1)} only"
        return InputError(what, remedy=f"got {fault['input']!r}")
    cause = fault.get("ctx", {}).get("error")
    got = f"got {repr(fault['input'])[:80]}" if path else ""  # not the whole file
    if isinstance(cause, AeroError):
        what, remedy = cause.what, cause.remedy or got
    else:
        what, remedy = fault["msg"].removeprefix("Value error, "), got
    return InputError(f"{path}: {what}".lstrip(": "), remedy=remedy)


def _key_of_error(data: Any, location: tuple[int | str, ...], kind: str) -> str:
    """Return the dotted key of an error, without the validator names that `location` contains."""
    kept = []
    for part in location:
        inside = (
            part in data
            if isinstance(data, Mapping)
            else isinstance(data, (list, tuple)) and part in range(len(data))
        )
        if inside:
            data = data[part]
            kept.append(str(part))
    if kind == "missing":
        kept.append(str(location[-1]))
    return ".".join(kept)


def _known_keys(model: type[BaseModel], path: tuple[int | str, ...]) -> list[str]:
    """Return the keys that the (nested) model at `path` accepts."""
    current: Any = model
    for part in path:
        field = (
            current.model_fields.get(str(part))
            if isinstance(current, type) and issubclass(current, BaseModel)
            else None
        )
        annotation = field.annotation if field is not None else current
        models = _models_in(annotation)
        if models:
            current = models[0]
    return (
        list(current.model_fields)
        if isinstance(current, type) and issubclass(current, BaseModel)
        else []
    )


def _models_in(annotation: Any) -> list[type[BaseModel]]:
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return [annotation]
    return [m for argument in getattr(annotation, "__args__", ()) for m in _models_in(argument)]
