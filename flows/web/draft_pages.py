"""Mappings that are drafted for a dropped log: a form to answer, with a picture of each channel
beside its line; the mapping file is what it gives. Nothing is stored."""

import re
from collections import OrderedDict
from pathlib import Path
from typing import Annotated, Any, Final

import numpy as np
from fastapi import APIRouter, Query, Request
from starlette.concurrency import run_in_threadpool
from starlette.responses import Response

from aerodb.errors import InputError, UnknownNameError
from aerodb.flows.web import models
from aerodb.flows.web.bodies import form_of
from aerodb.flows.web.change_pages import Token
from aerodb.flows.web.console import console_of, document, page_of
from aerodb.flows.web.models import answers
from aerodb.flows.web.sessions import check_csrf
from aerodb.flows.web.upload_pages import keep, made_of_log, permitted
from aerodb.logs import FormLine, MappingForm, answered, in_si, mapping_form
from aerodb.nomenclature import CHANNELS, channel
from aerodb.support import Array
from aerodb.tasks.view import drafted_mapping

router = APIRouter(tags=["changes"])
#: Most lines of a form: what a person answers at once, and fields of a request.
_LINES: Final = 40
#: Width and height of a picture.
_WIDTH: Final = 240.0
_HEIGHT: Final = 48.0


@router.post("/api/drafted/logs", summary="Draft a mapping", responses=answers(models.Drafted))
async def draft(
    request: Request,
    name: Annotated[str, Query(max_length=200, description="The file's name.")],
    token: Token = "",
) -> Response:
    """Receive a log as the body of the request, draft a mapping for it, and answer the address of
    the form to check it. Nothing is stored, and the form is kept until a few newer ones come."""
    form = await made_of_log(request, name, token, _drafted)
    if form is None:
        return Response(status_code=400)
    key = keep(request.app.state.drafted, (name, form))
    return document({"page": f"/drafts/{key}", "questions": list(form.questions)})


@router.get("/drafts/{key}", include_in_schema=False)
def draft_page(request: Request, key: str) -> Response:
    """The form of a draft."""
    name, form = _kept(request, key)
    return _page(request, key, name, form, form.lines, "")


@router.post("/drafts/{key}", include_in_schema=False)
async def check(request: Request, key: str) -> Response:
    """The form again, with what its answers show; kept where they make a mapping."""
    fields = await form_of(request)
    check_csrf(request, console_of(request).guard, fields.get("csrf"))
    await run_in_threadpool(permitted, request, None)
    name, form = _kept(request, key)
    said, lines = "", form.lines
    try:
        lines = (*_lines(form, fields), *form.lines[_LINES:])
        form = answered(form, lines)
        request.app.state.drafted[key] = (name, form)
    except InputError as error:
        said = "; ".join(each for each in (error.what, error.where, error.remedy) if each)
    return _page(request, key, name, form, lines, said)


@router.get("/drafts/{key}/mapping.toml", include_in_schema=False)
def mapping_file(request: Request, key: str) -> Response:
    """The mapping file of a draft, as it was last checked."""
    name, form = _kept(request, key)
    stem = re.sub(r"[^A-Za-z0-9_-]", "-", Path(name).stem)
    headers = {"content-disposition": f'attachment; filename="{stem or "log"}.mapping.toml"'}
    return Response(form.text, 200, headers, "application/toml; charset=utf-8")


def _kept(request: Request, key: str) -> tuple[str, MappingForm]:
    kept: OrderedDict[str, tuple[str, MappingForm]] = request.app.state.drafted
    if key not in kept:
        raise UnknownNameError("this draft is no longer kept", "/logs", "drop the log once more")
    return kept[key]


def _drafted(log: Path, root: Path, name: str) -> MappingForm:
    """Return the form of a received log."""
    with drafted_mapping(log, root, name) as (draft, recording):
        return mapping_form(recording, draft)


def _lines(form: MappingForm, fields: dict[str, str]) -> list[FormLine]:
    """The lines that a posted form holds; the last one, where it was filled in, is new."""
    places = list(form.columns)
    lines = []
    for k in range(_LINES + 1):
        if f"channel.{k}" not in fields:
            break
        number, scale = fields.get(f"field.{k}", ""), fields.get(f"scale.{k}", "1").strip()
        if not (number.isdecimal() and int(number) < len(places)):
            continue
        try:
            factor = float(scale or "1")
        except ValueError:
            raise InputError(f"'{scale[:40]}' is no scale", "the form", "write a number") from None
        if not np.isfinite(factor):
            raise InputError(f"'{scale[:40]}' is no scale", "the form", "write a number")
        place, named = places[int(number)], fields[f"channel.{k}"].strip()
        before = form.lines[k] if k < min(len(form.lines), _LINES) else None
        line = FormLine(named, place, fields.get(f"unit.{k}", "").strip(), factor)
        same = before is not None and (before.channel, before.place) == (named, place)
        if before is not None and same:
            line = FormLine(named, place, line.unit, factor, before.confidence, before.reason)
        lines.append(line)
    return lines


def _page(
    request: Request,
    key: str,
    name: str,
    form: MappingForm,
    lines: tuple[FormLine, ...],
    said: str,
) -> Response:
    places = list(form.columns)
    return page_of(
        request,
        "draft.html",
        f"Mapping of {name}",
        key=key,
        form=form,
        said=said,
        fields=[".".join(place) for place in places],
        channels=sorted(CHANNELS),
        lines=[
            {"line": line, "field": places.index(line.place), **_picture(form, line)}
            for line in lines[:_LINES]
            if line.place in form.columns
        ],
    )


def _picture(form: MappingForm, line: FormLine) -> dict[str, Any]:
    """What a line shows: its range in the unit of the channel, and points of a picture."""
    if not line.channel:
        return {"range": "not used", "curves": []}
    try:
        time, values = in_si(form, line)
        unit = channel(line.channel).unit
    except InputError as error:
        return {"range": error.what, "curves": []}
    good = np.isfinite(values)
    if not good.any():
        return {"range": "no value", "curves": []}
    low, high = float(values[good].min()), float(values[good].max())
    shown = f"{low:.4g} to {high:.4g} {unit}".removesuffix(" 1")
    return {"range": shown, "curves": _curves(time, values, low, high)}


def _curves(time: Array, values: Array, low: float, high: float) -> list[str]:
    """Points of the lines of a picture, one between gaps."""
    across = (time - time[0]) / max(float(time[-1] - time[0]), 1e-9) * _WIDTH
    up = _HEIGHT - 2.0 - (values - low) / max(high - low, 1e-300) * (_HEIGHT - 4.0)
    parts: list[list[str]] = [[]]
    for x, y in zip(across.tolist(), up.tolist(), strict=True):
        if np.isfinite(x) and np.isfinite(y):
            parts[-1].append(f"{x:.1f},{y:.1f}")
        elif parts[-1]:
            parts.append([])
    return [" ".join(part) for part in parts if part]
