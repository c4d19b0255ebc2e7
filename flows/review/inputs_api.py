"""The interface of the inputs view."""

from fastapi import APIRouter

router = APIRouter()
