"""Refusals of values, in terms of the options that gave them."""

from collections.abc import Iterator
from contextlib import contextmanager

import pydantic

from taichi_lsm.core.errors import InputError
from workflows.common.parameter_problems import as_written, option_name, without_effect
from workflows.common.parameters import OfOneWorkflow, ParameterError, Params


def checked(params_class: type[OfOneWorkflow], **values: object) -> OfOneWorkflow:
    """Parameters of a workflow that another workflow derives from its own.

    Raises
    ------
    InputError
        With every reason why the values are refused, in place of pydantic's error.
    """
    try:
        return params_class.model_validate(values)
    except pydantic.ValidationError as error:
        reasons = []
        for item in error.errors(include_url=False):
            reason = str(item.get("ctx", {}).get("error", "")) or item["msg"].replace("Input should", "must")
            name = option_name(".".join(map(str, item["loc"])))
            reasons.append(f"{name} {as_written(item['input'])}: {reason}" if item["loc"] else reason)
        raise InputError("; ".join(reasons)) from error


def derived(params_class: type[OfOneWorkflow], params: Params, **changes: object) -> OfOneWorkflow:
    """Parameters of one run of an experiment that makes many: those of the experiment, and what the run has of its own.

    None of them counts as given by the user: which options have no effect is known to the experiment, not to a run.

    Raises
    ------
    InputError
        As `checked`.
    """
    shared = params.model_dump(include=set(params_class.model_fields)) | changes
    of_run = checked(params_class, **shared)
    vars(of_run)["given"] = frozenset()  # in the place of the cached property
    return of_run


def check_idle(params: Params) -> None:
    """Refuse values that the user gave and that would change nothing.

    Raises
    ------
    ParameterError
        With each such option, its value and why it has no effect.
    """
    idle = params.idle()
    problems = [
        without_effect(name, getattr(params, name), reason, params.sources.get(name, ""))
        for name, reason in idle.items()
        if name in params.given
    ]
    if problems:
        raise ParameterError(problems)


@contextmanager
def in_terms_of(options: str, remedy: str) -> Iterator[None]:
    """Report what the library refuses within this block as a mistake in `options`.

    Parameters
    ----------
    options
        The options that gave the values, each with its value: "--length 6, --corner-radius 0.2".
    remedy
        How to mend it, as the end of the sentence.

    Raises
    ------
    InputError
        In place of every InputError. Any other exception is a programming error and passes unchanged.
    """
    try:
        yield
    except InputError as error:
        raise InputError(f"{options}: refused, as {str(error).rstrip('.')}; {remedy}") from error
