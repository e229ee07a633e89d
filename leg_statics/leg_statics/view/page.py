# SPDX-License-Identifier: Apache-2.0
"""The page in the browser: sliders and a 3-D picture of a scene, served on this machine only."""

from __future__ import annotations

import contextlib
import io
import math
import threading
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np
import viser
from numpy.typing import ArrayLike

from leg_kinematics.arrays import FloatArray, as_array
from leg_statics.view.readings import Reading, place_text, table
from leg_statics.view.scene import Scene, ask, ground, make_scene
from leg_statics.view.shapes import Arrows, Lines, Mesh, Points, Shape
from leg_statics.view.standing import NO_OFFSET, Playground, Setting, Standing
from leg_statics.workspace import is_spatial_leg

HOST = "127.0.0.1"  # nobody else's business
STEEPEST_TILT, FARTHEST_TURN = 25.0, 45.0  # degrees
HEIGHTS = (0.5, 1.4)  # of the body, as shares of its first height
REACH = 0.5  # of the sliders of a foot, as a share of the height of the legs
OF_FOOT = ("ahead", "aside", "above")  # sliders
ROUGHEST = 1.5
FIELD_OF_VIEW = 45.0  # degrees
PANEL_WIDTH = 310  # of the readings [pixels]
HEAVIEST = 4.0  # loads, as shares of those to begin with
NOT_ASKED = "Click a place on the ground to ask what the legs carry there."
LEGEND = """\
**Joints**: blue = idle, yellow = half of the limit, red = at the limit, purple = beyond it.
**Candidates**: purple to yellow = feasible, by load capacity; red = too heavy, pink = it would
slip, grey = a joint's range, black = singular. **Blue**: what the actuators can hold; where the
centre of mass may be. **Green**: friction cone. **Orange**: forces of the stance."""


class LiveStates(NamedTuple):
    """What a robot tells of itself.

    Attributes:
        joint_positions: Actuated joints of legs by name (n,) [rad or m].
        utilisation: Largest share of an effort limit of each leg, by name; NaN if not known.
        contact: Whether the feet of legs stand, by name; legs of which it is not known are left
            out.
    """

    joint_positions: Mapping[str, ArrayLike]
    utilisation: Mapping[str, float]
    contact: Mapping[str, bool]


class Page:
    """A robot in the browser. Whatever changes is drawn by one thread, the newest state only.

    Args:
        playground: The robot and its ground.
        port: Port of the server; 0 for any that is free.
        live: Whether a robot tells where its joints are (`show`); otherwise sliders do.
    """

    def __init__(self, playground: Playground, port: int = 8080, *, live: bool = False) -> None:
        self.playground = playground
        self.setting = playground.setting
        self._live = live
        self._states = LiveStates({}, {}, {})
        self._place: FloatArray | None = None
        self._drawn: dict[str, tuple[Shape, Any]] = {}
        self._changed, self._closing = threading.Event(), threading.Event()
        self._sliding = threading.Lock()  # the setting and the sliders agree when it is free
        with contextlib.redirect_stdout(io.StringIO()):  # a banner that names it all a second time
            self.server = viser.ViserServer(
                host=HOST, port=port, label="leg capacity", verbose=False
            )
        self.server.gui.configure_theme(show_logo=False, show_share_button=False)
        self.server.gui.main_panel.dock_right()
        self.server.scene.configure_default_lights(cast_shadow=False)
        self._set_camera()
        self._add_controls()
        self._add_readings()
        self._draw("ground", ground(playground))
        self.server.scene.on_click()(self._clicked)
        self._drawer = threading.Thread(target=self._keep_drawing, name="drawer", daemon=True)
        self._changed.set()
        self._drawer.start()

    @property
    def address(self) -> str:
        """Where to find the page."""
        return f"http://{HOST}:{self.server.get_port()}"

    def show(self, states: LiveStates) -> None:
        """Show a robot as it tells of itself; legs that are not told stay as they were.

        Raises:
            UnknownNameError: If the robot has no leg of a name.
            ShapeError: If a leg has another number of joints.
        """
        for name, positions in states.joint_positions.items():
            n = len(self.playground.robot.leg(name).joint_names)
            as_array(f"joint positions of {name}", positions, n)
        self._states = LiveStates(
            {**self._states.joint_positions, **states.joint_positions},
            {**self._states.utilisation, **states.utilisation},
            {
                **{
                    k: v for k, v in self._states.contact.items() if k not in states.joint_positions
                },
                **states.contact,
            },
        )
        self._changed.set()

    def close(self) -> None:
        """End the server."""
        self._closing.set()
        self._changed.set()
        self._drawer.join()
        self.server.stop()

    @property
    def place(self) -> FloatArray | None:
        """The place that was asked for (3,) [m]; None before a click."""
        return self._place

    # ------------------------------------------------------------------ controls

    def _add_controls(self) -> None:
        gui, first, unit = self.server.gui, self.setting, self.playground.unit
        legs = tuple(self.playground.robot.legs)
        gui.add_markdown(f"### {self.playground.robot.name}")
        self._leg = gui.add_dropdown("leg", legs, initial_value=first.leg)
        self._leg.on_update(lambda _: self._choose_leg())
        self._sliders: dict[str, Any] = {}

        def add(name: str, label: str, low: float, high: float, value: float, digits: int) -> None:
            slider = gui.add_slider(label, low, high, 10.0**-digits, value)
            slider.on_update(lambda _: self._changed.set())
            self._sliders[name] = slider

        if not self._live:
            with gui.add_folder("foot"):
                for name, label in (("ahead", "forward [m]"), ("aside", "left [m]")):
                    add(name, label, *_range(REACH * unit), 0.0, 3)
                add("above", "above the ground [m]", 0.0, _up(REACH * unit), 0.0, 3)
            with gui.add_folder("body"):
                height = first.height
                low, high = (share * max(height, unit) for share in HEIGHTS)
                add("height", "height [m]", _down(low), _up(high), height, 3)
                for name in ("roll", "pitch"):
                    add(name, f"{name} [°]", -STEEPEST_TILT, STEEPEST_TILT, 0.0, 1)
                add("yaw", "yaw [°]", -FARTHEST_TURN, FARTHEST_TURN, 0.0, 1)
        with gui.add_folder("ground and loads"):
            add("friction", "friction coefficient", 0.0, ROUGHEST, first.friction, 2)
            most = max(HEAVIEST * first.load, 1.0)
            add("load", "load of a foothold [N]", 0.0, most, first.load, 1)
            most = max(HEAVIEST * first.mass, 1.0)
            add("mass", "mass of the robot [kg]", 0.0, most, first.mass, 2)
        self._enable_foot()

    def _add_readings(self) -> None:
        gui = self.server.gui
        panel = gui.add_panel()
        panel.dock_left()
        panel.set_width(PANEL_WIDTH)
        with panel.add_tab("what it carries"):
            with gui.add_folder("the leg"):
                self._told_of_leg = gui.add_markdown("")
            with gui.add_folder("the stance"):
                self._told_of_stance = gui.add_markdown("")
            with gui.add_folder("asked place"):
                self._answer = gui.add_markdown(NOT_ASKED)
            with gui.add_folder("colours"):
                gui.add_markdown(LEGEND)

    def _choose_leg(self) -> None:
        """Let the sliders of the foot show those of the leg that is chosen."""
        with self._sliding:
            self.setting = replace(self.setting, leg=self._leg.value)
            offset = self.setting.feet.get(self.setting.leg, NO_OFFSET)
            for name, value in zip(OF_FOOT, offset, strict=True):
                if name in self._sliders:
                    self._sliders[name].value = value
            self._enable_foot()
        self._changed.set()

    def _enable_foot(self) -> None:
        movable = is_spatial_leg(self.playground.robot.leg(self.setting.leg).mechanism)
        for name in OF_FOOT:
            if name in self._sliders:
                self._sliders[name].disabled = not movable

    def _read_sliders(self) -> Setting:
        """Return what is set."""
        values: dict[str, Any] = {n: float(s.value) for n, s in self._sliders.items()}
        for name in ("roll", "pitch", "yaw"):
            if name in values:
                values[name] = math.radians(values[name])
        feet = dict(self.setting.feet)
        if not self._live:
            ahead, aside, above = (values.pop(name) for name in OF_FOOT)
            feet[self.setting.leg] = ahead, aside, above
        return replace(self.setting, feet=feet, **values)

    # ------------------------------------------------------------------ drawing

    def _keep_drawing(self) -> None:
        while self._changed.wait() and not self._closing.is_set():
            self._changed.clear()
            with self._sliding:
                self.setting = self._read_sliders()
            standing = self._stand()
            used = self._states.utilisation if self._live else None
            scene = make_scene(self.playground, standing, self.setting, used)
            with self.server.atomic():
                self._put(scene)
                self._put_answer(standing)

    def _stand(self) -> Standing:
        if self._live:
            states = self._states
            return self.playground.stand_as(states.joint_positions, states.contact)
        return self.playground.stand(self.setting)

    def _put(self, scene: Scene) -> None:
        """Draw a scene in place of the one before."""
        for name in set(self._drawn) - set(scene.shapes) - {"ground", "asked"}:
            self._drawn.pop(name)[1].remove()
        for name, shape in scene.shapes.items():
            self._draw(name, shape)
        self._told_of_leg.content = table(scene.leg)
        self._told_of_stance.content = table(scene.stance)

    def _put_answer(self, standing: Standing) -> None:
        """Show what the legs carry at the place that was asked for."""
        if self._place is None:
            return
        size = 0.05 * self.playground.unit
        self._draw("asked", Points(self._place[None], np.zeros((1, 3)), size))
        answers = ask(self.playground, standing, self.setting, self._place)
        self._answer.content = answer_text(self._place, answers)

    def _draw(self, name: str, shape: Shape) -> None:
        """Draw a shape, unless it is there already."""
        known = self._drawn.get(name)
        if known is not None and type(known[0]) is type(shape) and _same(known[0], shape):
            return
        handle = _DRAW[type(shape)](self.server.scene, f"/{name}", shape)
        self._drawn[name] = shape, handle

    def _clicked(self, event: Any) -> None:
        place = self.playground.terrain.seen(event.ray_origin, event.ray_direction)
        if place is not None:
            self._place = place
            self._changed.set()

    def _set_camera(self) -> None:
        unit, height = self.playground.unit, self.setting.height
        reach = max(abs(float(v)) for foot in self.playground.first_feet.values() for v in foot[:2])
        away = 1.5 * (reach + unit)
        camera = self.server.initial_camera
        camera.position = (away, away, height + 0.8 * away)  # the first leg is ahead on the left
        camera.look_at = (0.0, 0.0, 0.4 * height)
        camera.fov = math.radians(FIELD_OF_VIEW)


def _range(most: float) -> tuple[float, float]:
    return -_up(most), _up(most)


def _up(value: float) -> float:
    return math.ceil(1e2 * value) / 1e2


def _down(value: float) -> float:
    return math.floor(1e2 * value) / 1e2


def _same(one: Shape, other: Shape) -> bool:
    """Tell whether two shapes of a kind look the same."""
    fields: list[tuple[Any, Any]] = list(zip(one, other, strict=True))
    return all(np.array_equal(a, b) for a, b in fields)


def answer_text(place: FloatArray, answers: Mapping[str, tuple[Reading, ...]]) -> str:
    """Return what is said of a place that was asked for (3,) [m], as Markdown."""
    where = place_text(place)
    if not answers:
        return f"**{where}**: no leg reaches it."
    parts = [f"**{name}**\n\n{table(lines)}" for name, lines in answers.items()]
    return "\n\n".join([f"**{where}**", *parts])


# --------------------------------------------------------------------------- shapes


def _draw_lines(scene: Any, name: str, shape: Lines) -> Any:
    return scene.add_line_segments(name, shape.ends, shape.colour, thickness=shape.width)


def _draw_points(scene: Any, name: str, shape: Points) -> Any:
    return scene.add_point_cloud(
        name,
        shape.places,
        shape.colours,
        point_size=shape.size,
        point_shape="circle",
        precision="float32",
        point_shading="flat",
    )


def _draw_arrows(scene: Any, name: str, shape: Arrows) -> Any:
    return scene.add_arrows(
        name,
        shape.ends,
        shape.colour,
        shaft_radius=0.5 * shape.width,
        head_radius=1.2 * shape.width,
        head_length=3.0 * shape.width,
    )


def _draw_mesh(scene: Any, name: str, shape: Mesh) -> Any:
    return scene.add_mesh_simple(
        name,
        shape.vertices,
        shape.faces,
        color=tuple(round(255 * float(part)) for part in shape.colour),
        opacity=None if shape.opacity == 1.0 else shape.opacity,
        flat_shading=True,
        side="double",
        cast_shadow=False,
        receive_shadow=False,
    )


_DRAW: dict[type, Callable[[Any, str, Any], Any]] = {
    Lines: _draw_lines,
    Points: _draw_points,
    Arrows: _draw_arrows,
    Mesh: _draw_mesh,
}
