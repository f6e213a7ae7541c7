"""The room's API for other programs: JSON, reading alone, described in OpenAPI.

Whoever wants something done says so on the page's WebSocket or at the terminal: a request changes nothing.
"""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from http import HTTPStatus
from importlib.metadata import version
from typing import Any, NamedTuple

from pydantic import TypeAdapter
from starlette.requests import Request
from starlette.responses import Response

from nathlon.arena.store import FoundEntrant, Store
from nathlon.lab.serve.work import (
    NightRecord,
    WorkState,
    night_records,
    work_state,
)
from nathlon.lab.web.access import answer, headers

JSON = "application/json"
SEARCH = "search"
LONGEST_SEARCH, MOST_FOUND = 500, 200
"""Letters, and checkpoints that a search finds at once."""


class ApiPath(NamedTuple):
    """What is answered at a path.

    Attributes:
        summary: of it, for the description.
        kind: of the answer.
        answer: from a store and the text that is searched for, '' where nothing is.
        searches: whether it takes one.
    """

    summary: str
    kind: TypeAdapter[Any]
    answer: Callable[[Store, str], Any]
    searches: bool = False


PATHS: dict[str, ApiPath] = {
    "work": ApiPath(
        "Who runs matches, what waits, and what the run under way is at.",
        TypeAdapter(WorkState),
        lambda store, _: work_state(store),
    ),
    "nights": ApiPath(
        "What all nights came to, the last first.",
        TypeAdapter(list[NightRecord]),
        lambda store, _: night_records(store),
    ),
    "checkpoints": ApiPath(
        "Checkpoints of all runs with a text in their name, path or id, the latest run's first; 200 at most.",
        TypeAdapter(list[FoundEntrant]),
        lambda store, text: store.find_entrants(text, MOST_FOUND),
        searches=True,
    ),
}


def openapi() -> dict[str, Any]:
    """The API's description, OpenAPI 3.1."""
    schemas: dict[str, Any] = {}
    paths: dict[str, Any] = {}
    for name, path in PATHS.items():
        schema = path.kind.json_schema(mode="serialization", ref_template="#/components/schemas/{model}")
        schemas |= schema.pop("$defs", {})
        content = {JSON: {"schema": schema}}
        search = {"name": SEARCH, "in": "query", "schema": {"type": "string", "maxLength": LONGEST_SEARCH}}
        paths[f"/api/{name}"] = {
            "get": {
                "summary": path.summary,
                "parameters": [search] if path.searches else [],
                "responses": {
                    "200": {"description": "The answer.", "content": content},
                    "403": {"description": "No member's token, or another name for this server."},
                },
            }
        }
    return {
        "openapi": "3.1.0",
        "info": {"title": "nathlon: the committee's room", "version": version("nathlon")},
        "paths": paths,
        "components": {
            "schemas": schemas,
            "securitySchemes": {"member": {"type": "http", "scheme": "bearer"}},
        },
        "security": [{"member": []}],
    }


async def answer_api(
    request: Request, name: str, asked: Callable[[Callable[[Store], Any]], Awaitable[Any]]
) -> Response:
    """The answer to a member's request.

    Args:
        request: which has been let in, and has a member's token.
        name: of the path, after `/api/`.
        asked: has a function of the store called.
    """
    if name == "openapi.json":
        return _json(TypeAdapter(dict[str, Any]).dump_json(openapi()))
    path, text = PATHS.get(name), request.query_params.get(SEARCH, "")
    if path is None:
        return answer(HTTPStatus.NOT_FOUND)
    if len(text) > LONGEST_SEARCH:
        return answer(HTTPStatus.BAD_REQUEST)
    return _json(path.kind.dump_json(await asked(lambda store: path.answer(store, text))))


def _json(content: bytes) -> Response:
    return Response(content, HTTPStatus.OK, headers(), JSON)
