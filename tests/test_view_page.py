# SPDX-License-Identifier: Apache-2.0
"""The page in a real browser: it loads, sliders change numbers, a click is answered, also live."""

from __future__ import annotations

import re
import socket
import subprocess
from contextlib import closing, contextmanager
from dataclasses import replace

import numpy as np
import pytest
from headless_browser import NoBrowserError, open_browser
from leg_msgs.msg import LegState, LegStates
from leg_msgs_py.client import LegClient
from node_processes import NodeProcesses
from nodes_support import PATIENCE, wait_for
from playwright.sync_api import expect

from leg_kinematics.errors import ShapeError, UnknownNameError
from leg_statics import Contact, evaluate_footholds
from leg_statics.view.page import LiveStates, Page
from leg_statics.view.readings import place_text
from leg_statics.view.scene import ask, make_scene
from leg_statics.view.standing import Playground

LEG = "left_front"
# Few and coarse pixels: they are drawn without a graphics card.
LOOK = {"viewport": {"width": 900, "height": 400}, "device_scale_factor": 0.25}


@pytest.fixture(scope="module")
def browser():
    expect.set_options(timeout=1e3 * PATIENCE)
    try:
        with open_browser() as opened:
            yield opened
    except NoBrowserError as error:
        pytest.skip(str(error))


@pytest.fixture(scope="module")
def playground(hexapod):
    return Playground.of(hexapod, "rough")


@pytest.fixture(scope="module")
def page(playground):
    with closing(Page(playground, port=0)) as opened:
        yield opened


@contextmanager
def looked_at(browser, address):
    """A tab that shows an address; it may have logged no error in the end."""
    tab = browser.new_page(**LOOK)
    tab.set_default_timeout(1e3 * PATIENCE)
    errors = []
    tab.on("console", lambda message: errors.append(message.text) if message.type == "error" else 0)
    tab.on("pageerror", lambda error: errors.append(str(error)))
    tab.on("request", lambda request: errors.extend(strangers(request.url, address)))
    tab.goto(address)
    reading(tab, "verdict").wait_for()
    yield tab
    tab.close()
    assert errors == []


def strangers(url, address):
    """The address itself unless it is of this page: nothing is asked of another machine."""
    return [] if url.removeprefix("blob:").startswith((address, "data:")) else [url]


@pytest.fixture(scope="module")
def tab(browser, page):
    with looked_at(browser, page.address) as opened:
        yield opened


def reading(tab, label):
    """What is said beside a label, the first of that name: of the leg that is looked at."""
    row = tab.get_by_role("row").filter(has=tab.get_by_role("cell", name=label, exact=True))
    return row.first.get_by_role("cell").nth(1)


def control(tab, label):
    """What a label stands beside."""
    name = tab.locator("label", has_text=label).get_attribute("for")
    return tab.locator(f"[id='{name}']")


def push(tab, label, key):
    """Push a slider by a key and return what it then says."""
    thumb = control(tab, label).get_by_role("slider")
    before = thumb.get_attribute("aria-valuenow")
    thumb.press(key)
    expect(thumb).not_to_have_attribute("aria-valuenow", before)
    return float(thumb.get_attribute("aria-valuenow"))


def told(scene):
    return {line.label: line.text for line in (*scene.leg, *scene.stance)}


def test_the_page_shows_what_the_library_says(tab, page, playground):
    setting = playground.setting
    expected = told(make_scene(playground, playground.stand(setting), setting))
    assert expected["stance"] == "6 feet: stands"
    for label, text in expected.items():
        expect(reading(tab, label)).to_have_text(text)
    assert tab.locator("canvas").count() >= 1


def test_the_friction_slider_changes_the_load_capacity_to_that_of_evaluate_footholds(
    tab, playground
):
    before = reading(tab, "load capacity").text_content()
    friction = push(tab, "friction coefficient", "Home")
    setting = replace(playground.setting, friction=friction)
    leg, place = playground.robot.leg(LEG), playground.foot_of(LEG, setting)
    foot = leg.mount.to_leg(place - [0.0, 0.0, setting.height])
    normal = leg.mount.vectors_to_leg(playground.terrain.normal(place))
    found = evaluate_footholds(leg, foot, Contact(friction, normal, setting.load))
    expect(reading(tab, "load capacity")).to_have_text(f"{found.load_capacity:.1f} N")
    assert reading(tab, "load capacity").text_content() != before
    assert friction == 0.0


@pytest.mark.parametrize(
    ("label", "name"),
    [("forward", "ahead"), ("height", "height"), ("roll", "roll"), ("mass", "mass")],
)
def test_sliders_of_foot_body_and_mass_change_the_numbers(tab, page, playground, label, name):
    value = push(tab, label, "ArrowRight")
    wait_for(lambda: told_by(page, name) == pytest.approx(value))
    setting = page.setting
    expected = told(make_scene(playground, playground.stand(setting), setting))
    for line, text in expected.items():
        expect(reading(tab, line)).to_have_text(text)


def told_by(page, name):
    """What a slider has set, in its unit."""
    if name == "ahead":
        return page.setting.feet[LEG][0]
    value = getattr(page.setting, name)
    return np.degrees(value) if name in ("roll", "pitch", "yaw") else value


def test_a_click_on_the_ground_is_answered_for_that_place(tab, page, playground):
    foot = playground.foot_of(LEG, page.setting)
    tab.mouse.click(*pixel(tab, page, foot))
    wait_for(lambda: page.place is not None)
    place = page.place
    assert place == pytest.approx(foot, abs=0.05 * playground.unit)
    assert place[2] == pytest.approx(playground.terrain.height(place), abs=1e-9)
    answers = ask(playground, playground.stand(page.setting), page.setting, place)
    assert LEG in answers
    tab.get_by_text(place_text(place), exact=True).wait_for()
    capacities = [lines[1].text for lines in answers.values()]
    cells = tab.get_by_role("row").filter(has_text="load capacity")
    expect(cells).to_have_count(1 + len(answers))
    for k, text in enumerate(capacities):
        expect(cells.nth(1 + k)).to_contain_text(text)


def pixel(tab, page, point):
    """Where a point of the map is on the page."""
    (client,) = page.server.get_clients().values()
    camera = client.camera
    w, x, y, z = camera.wxyz
    vector = np.array([x, y, z])
    away = point - camera.position  # turned back by the camera's quaternion
    seen = away + 2.0 * np.cross(vector, np.cross(vector, away) - w * away)
    box = tab.locator("canvas").first.bounding_box()
    scale = 0.5 * box["height"] / np.tan(0.5 * camera.fov) / seen[2]
    centre = box["x"] + 0.5 * box["width"], box["y"] + 0.5 * box["height"]
    return centre[0] + scale * seen[0], centre[1] + scale * seen[1]


def test_another_leg_can_be_chosen(tab, page, playground):
    control(tab, "leg").click()
    tab.get_by_role("option", name="right_rear").click()
    wait_for(lambda: page.setting.leg == "right_rear")
    setting = page.setting
    assert setting.feet["right_rear"] == (0.0, 0.0, 0.0)
    assert setting.feet[LEG][0] > 0.0
    expected = told(make_scene(playground, playground.stand(setting), setting))
    expect(reading(tab, "foot")).to_have_text(expected["foot"])


def test_what_a_robot_of_another_kind_tells_is_refused(page):
    with pytest.raises(ShapeError, match=LEG):
        page.show(LiveStates({LEG: [0.0, 0.0]}, {}, {}))
    with pytest.raises(UnknownNameError, match="tail"):
        page.show(LiveStates({"tail": [0.0, 0.0, 0.0]}, {}, {}))


def test_the_page_is_served_on_this_machine_only(page):
    port = page.server.get_port()
    listening = subprocess.run(["cat", "/proc/net/tcp", "/proc/net/tcp6"], capture_output=True)
    rows = re.findall(rb"([0-9A-F]{8,32}):([0-9A-F]{4}) [0-9A-F:]+ 0A", listening.stdout)
    bound = {address for address, number in rows if int(number, 16) == port}
    assert bound == {socket.inet_aton("127.0.0.1")[::-1].hex().upper().encode()}


def test_the_viewer_node_shows_leg_states(browser, hexapod):
    level = Playground.of(hexapod)
    standing = level.stand(replace(level.setting, feet={LEG: (0.06, 0.0, 0.1)}))
    states = LegStates(
        legs=[
            LegState(leg=name, joint_positions=posture.joint_positions, utilisation=0.5)
            for name, posture in standing.postures.items()
        ]
    )
    nodes = NodeProcesses(
        names=["viewer"], parameters={"port": 0}, stderr=subprocess.PIPE, text=True
    )
    with nodes, LegClient(timeout=PATIENCE) as client:
        address = shown_at(nodes.processes["viewer"])
        publisher = client.node.create_publisher(LegStates, "/statics/leg_states", 10)
        with looked_at(browser, address) as tab:
            expect(reading(tab, "stance")).to_contain_text("6 feet")
            assert tab.get_by_text("forward").count() == 0  # nobody moves a robot from here

            def shows(feet):
                publisher.publish(states)  # again and again, as a robot does
                return feet in (reading(tab, "stance").text_content() or "")

            wait_for(lambda: shows("5 feet"))
            states.legs[1].contact = LegState.IN_THE_AIR
            wait_for(lambda: shows("4 feet"))


def shown_at(process):
    """The address that a viewer node logs."""
    said = []
    while not (found := re.search(r"shown at (\S+)", said[-1] if said else "")):
        said.append(process.stderr.readline())
        assert said[-1], "".join(said)
    return found[1]
