# SPDX-License-Identifier: Apache-2.0
"""What a client can be asked, said once: `legs.ask(...)` waits, `legs.ask.future(...)` does not.

A family of questions is a module of functions such as

    @question("statics", QueryFootholds)
    def query_footholds(leg: str, positions: ArrayLike, ...) -> Request[Footholds]:

that make the request and say how its response is read. `LegClient` names them as its methods.
"""

from __future__ import annotations

import inspect
from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial, wraps
from typing import (
    Any,
    Concatenate,
    Generic,
    ParamSpec,
    Protocol,
    TypeVar,
    get_args,
    get_type_hints,
    overload,
)

from leg_msgs_py.client.calls import Caller, CallFuture
from leg_msgs_py.client.goals import GoalFuture, send_goal
from leg_msgs_py.client.inputs import Points
from leg_msgs_py.naming import interface_name

P = ParamSpec("P")
T = TypeVar("T")
F = TypeVar("F", bound=CallFuture[Any])


@dataclass(frozen=True)
class Request(Generic[T]):
    """A request of a service, and how its response is read.

    Attributes:
        message: The request.
        decode: Makes the answer of a response.
        points: The points that it asks about, of which a client accepts only so many.
    """

    message: Any
    decode: Callable[[Any], T]
    points: Points | None = None


@dataclass(frozen=True)
class Goal(Generic[T]):
    """A goal of an action, and how its result is read.

    Attributes:
        message: The goal.
        decode: Makes the answer of a result.
        on_feedback: Called with every feedback; what it raises ends the work.
    """

    message: Any
    decode: Callable[[Any], T]
    on_feedback: Callable[[Any], None]


class Client(Protocol):
    """What asks.

    Attributes:
        caller: Sends requests and goals.
        max_points: Points accepted in one request.
    """

    caller: Caller
    max_points: int

    def name_of(self, server: str, interface: str) -> str:
        """Return the full name of a service or action of a node."""


class Asked(Generic[P, T, F]):
    """A question of one client: call it to wait for the answer, `future` not to wait."""

    def __init__(self, method: _Method[P, T, F], client: Client) -> None:
        self.__doc__ = method.function.__doc__
        self.__name__ = method.function.__name__
        self.__signature__ = method.signature
        self._method = method
        self._client = client

    def __call__(self, *args: P.args, **kwargs: P.kwargs) -> T:
        """Ask, and wait for the answer."""
        answer: T = self.future(*args, **kwargs).wait()
        return answer

    def future(self, *args: P.args, **kwargs: P.kwargs) -> F:
        """Ask, and return the answer to come at once."""
        return self._method.send(self._client, self._method.make(*args, **kwargs))

    def __repr__(self) -> str:
        """Return name and parameters, as `help` shows them."""
        return f"{self.__name__}{self.__signature__}"


class _Method(ABC, Generic[P, T, F]):
    """A method of a client that asks a node.

    Attributes:
        server: Name of the node.
        interface: Type of its service or action.
        name: Its name below the node's.
        make: Makes what is sent.
        function: The method as the class has it.
        signature: How it is called on a client.
    """

    def __init__(self, server: str, interface: Any, make: Callable[P, Any]) -> None:
        self.server = server
        self.interface = interface
        self.name = interface_name(interface)
        self.make = make
        self.function = _function(make)
        self.signature = _signature(make)

    @abstractmethod
    def send(self, client: Client, content: Any) -> F:
        """Send what was made, and return the answer to come."""

    @overload
    def __get__(self, client: None, owner: Any) -> Callable[Concatenate[Any, P], T]: ...

    @overload
    def __get__(self, client: Client, owner: Any) -> Asked[P, T, F]: ...

    def __get__(self, client: Client | None, owner: Any = None) -> Any:
        """Return the question of a client; of the class, a function that tells how to ask."""
        if client is None:
            return self.function
        return Asked(self, client)


class Question(_Method[P, T, CallFuture[T]]):
    """A method that asks a service."""

    def send(self, client: Client, content: Request[T]) -> CallFuture[T]:
        """Send a request.

        Raises:
            TooLargeError: If it asks about more points than the client accepts.
        """
        if content.points is not None:
            content.points.check_count(client.max_points)
        name = client.name_of(self.server, self.name)
        return client.caller.call(name, self.interface, content.message, content.decode)


class Order(_Method[P, T, GoalFuture[T]]):
    """A method that orders the work of an action.

    The future's `cancel` stops the work; its `wait` then raises a `CancelledError` whose `partial`
    is what there was until then.
    """

    def send(self, client: Client, content: Goal[T]) -> GoalFuture[T]:
        """Send a goal."""
        action = (client.name_of(self.server, self.name), self.interface)
        return send_goal(
            client.caller, action, content.message, content.decode, content.on_feedback
        )


def question(server: str, service: Any) -> Callable[[Callable[P, Request[T]]], Question[P, T]]:
    """Return a decorator for a function that makes requests of a node's service."""
    return partial(Question, server, service)


def order(server: str, action: Any) -> Callable[[Callable[P, Goal[T]]], Order[P, T]]:
    """Return a decorator for a function that makes goals of a node's action."""
    return partial(Order, server, action)


def _signature(make: Callable[..., Any]) -> inspect.Signature:
    """Return the signature of a question, which returns the answer to what `make` makes."""
    (answer,) = get_args(get_type_hints(make)["return"])
    return inspect.signature(make).replace(return_annotation=answer)


def _function(make: Callable[..., Any]) -> Callable[..., Any]:
    """Return the method that `help` shows of the class."""

    @wraps(make)
    def method(self: Any, *args: Any, **kwargs: Any) -> Any:
        return getattr(self, make.__name__)(*args, **kwargs)

    signature = _signature(make)
    itself = inspect.Parameter("self", inspect.Parameter.POSITIONAL_OR_KEYWORD)
    parameters = [itself, *signature.parameters.values()]
    method.__signature__ = signature.replace(parameters=parameters)  # type: ignore[attr-defined]
    return method
