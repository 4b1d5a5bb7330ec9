"""Negotiation: which of the media types on offer a client wants most (RFC 9110, section 12.5)."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import Any, NamedTuple

from fluentboard.errors import NotAcceptable


class Offer(NamedTuple):
    """A media type that can be produced.

    Attributes:
        media_type: without parameters, in lower case; the value of Content-Type.
        format: what produces it; its meaning is the caller's.
    """

    media_type: str
    format: Any


class _Range(NamedTuple):
    main: str
    sub: str
    quality: float

    def specificity(self, main: str, sub: str) -> int:
        """How closely the range names a type: 3 exactly, 1 not more than `*/*`, 0 not at all."""
        if self.main == "*":
            return 1
        if self.main != main:
            return 0
        return 3 if self.sub == sub else 2 if self.sub == "*" else 0


@lru_cache(maxsize=1024)
def negotiated(accept: str | None, offers: tuple[Offer, ...]) -> Offer:
    """The offer that the client prefers; among equals the first.

    Args:
        accept: value of the Accept header, or None if the client sent none.
        offers: what can be produced, in the server's order of preference.

    Raises:
        NotAcceptable: the client accepts none of them.
    """
    if accept is None or not accept.strip():
        return offers[0]
    ranges = _ranges(accept)
    best, best_quality = offers[0], 0.0
    for offer in offers:
        quality = _quality(offer.media_type, ranges)
        if quality > best_quality:
            best, best_quality = offer, quality
    if best_quality == 0.0:
        available = [offer.media_type for offer in offers]
        raise NotAcceptable(
            f"cannot answer with {accept!r}; available are {', '.join(available)}",
            available=available,
        )
    return best


def content_type(media_type: str) -> bytes:
    """The value of Content-Type; text is UTF-8, which some clients believe only when told."""
    return (
        f"{media_type}; charset=utf-8".encode()
        if media_type[:5] == "text/"
        else media_type.encode()
    )


def _quality(media_type: str, ranges: Sequence[_Range]) -> float:
    main, _, sub = media_type.partition("/")
    # The most specific range decides: `*/*;q=1, text/csv;q=0` excludes CSV.
    specificity, quality = 0, 0.0
    for candidate in ranges:
        fits = candidate.specificity(main, sub)
        if fits > specificity or (fits == specificity and fits and candidate.quality > quality):
            specificity, quality = fits, candidate.quality
    return quality


def _ranges(accept: str) -> list[_Range]:
    found: list[_Range] = []
    for entry in accept.split(","):
        media_range, *parameters = entry.split(";")
        main, slash, sub = media_range.strip().lower().partition("/")
        # `*` alone is not in the standard, but Java's URLConnection sends it.
        if main == "*" and not slash:
            sub = "*"
        if main and sub:
            found.append(_Range(main, sub, _q(parameters)))
    return found


def _q(parameters: Sequence[str]) -> float:
    for parameter in parameters:
        name, _, value = parameter.partition("=")
        if name.strip().lower() == "q":
            try:
                return min(max(float(value), 0.0), 1.0)
            except ValueError:
                return 0.0
    return 1.0
