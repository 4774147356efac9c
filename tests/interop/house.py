"""A small house for both versions of ROS: two ways from one dock to the other, of which one is always crowded in the recorded days."""

import json
import os
import random
import time

PLACES = {"charger": (-8, 0, "charger"), "left": (0, 0, "corridor"), "upper": (6, 5, "shelf"), "lower": (6, -6, "shelf"),
          "right": (12, 0, "corridor"), "dock_w": (0, 8, "dock"), "dock_e": (18, 0, "dock"), "entrance": (12, 8, "entrance")}
ARCS = [("charger", "left"), ("left", "upper"), ("left", "lower"), ("upper", "right"), ("lower", "right"), ("dock_w", "left"),
        ("dock_e", "right"), ("entrance", "right")]
CROWDED, FREE = "upper", "lower"


def write(folder):
    """Writes scenario (which is the map, too), model and two days. Returns the paths of the three."""
    scenario, model, days = (os.path.join(folder, name) for name in ("house.toml", "model.json", "days"))
    places = ["{ name = '%s', at = [%.1f, %.1f], kind = '%s' }" % (name, x, y, kind) for name, (x, y, kind) in PLACES.items()]
    with open(scenario, "w") as file:
        file.write("""plan = "crowd"
duration = 900.0
people = []
walls = [[-20.0, -15.0, 25.0, -15.0], [25.0, -15.0, 25.0, 20.0], [25.0, 20.0, -20.0, 20.0], [-20.0, 20.0, -20.0, -15.0]]
[[robots]]
start = [-8.0, 0.0]
drive = { speed = 0.8, turn_rate = 1.5, pause = [0.0, 0.0] }
[day]
hours = 0.25
teams = [3]
tasks = 4
places = [%s]
arcs = %s
""" % (", ".join(places), json.dumps(ARCS)))
    links = [{"cause": cause, "effect": effect, "lag": 1} for cause, effect in
             (("people", "people"), ("robot", "people"), ("hour", "hour"))]
    with open(model, "w") as file:
        json.dump({"links": links}, file)
    os.mkdir(days)
    rng = random.Random(3)
    for day in range(2):
        with open(os.path.join(days, "day_%d.csv" % day), "w") as file:
            file.write("time,place,people,robot,hour,speed,loss,load\n")
            before = dict.fromkeys(PLACES, 0)
            for row in range(360):
                for number, name in enumerate(PLACES):
                    people = max(0, (6 if name == CROWDED else 0) + rng.choice((-1, 0, 0, 1)))
                    here = number == (row // 3) % len(PLACES)
                    fared = "%.3f,%.5f,%d" % (0.8 / (1 + before[name]), 0.006 + 0.001 * rng.random(), row % 2) if here else ",,"
                    file.write("%d,%d,%d,%d,%.4f,%s\n" % (10 * row, number, people, here, 8 + row / 360, fared))
                    before[name] = people
    return scenario, model, days


def check(answer, leg):
    """An answer of /roscausal/route on a way that the simulator asks for."""
    assert answer.status == 0 and answer.wait <= leg["wait"] + 1, answer
    assert answer.places[0] == leg["from"] and answer.places[-1] == leg["to"], answer
    assert CROWDED not in answer.places, answer
    assert answer.lower < answer.seconds < answer.upper and answer.text and "2 days" in answer.caveats[0], answer
    return "%r %s" % (answer.wait, " ".join(answer.places))


def offset():
    """Hours from UTC to half past eight, now."""
    return 8.5 - time.time() / 3600 % 24


def check_grid(grid):
    """The grid of costs: dear at the crowded place, cheap at the free one, unknown far away."""
    info = grid.info

    def at(place):
        x, y, _ = PLACES[place]
        column, row = (int((value - low) / info.resolution) for value, low in ((x, info.origin.position.x), (y, info.origin.position.y)))
        return grid.data[row * info.width + column]

    assert grid.header.frame_id == "map" and len(grid.data) == info.width * info.height, info
    assert at(CROWDED) == 100 and 0 <= at(FREE) < 20 and grid.data[0] == -1, (at(CROWDED), at(FREE), grid.data[0])
