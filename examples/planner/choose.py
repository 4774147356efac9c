"""The question of a planner, and its choice; the same for rospy and rclpy, whose message classes are given."""

SPEEDS = (0.2, 0.5, 0.8)
HORIZON = 10


def question(msgs, request, variable="r_v", speeds=SPEEDS, cost=("h_risk=1.0",), limit=None):
    """Fills a WhatIf request: one action for each speed, held for the whole horizon. `limit` is (variable, above, probability)."""
    request.horizon = HORIZON
    request.actions = [
        msgs.Action(
            name=f"{speed:g}",
            interventions=[msgs.Intervention(variable=variable, type=msgs.Intervention.SET, first_step=1, last_step=0, values=[speed])],
        )
        for speed in speeds
    ]
    for term in cost:
        name, weight = term.split("=")
        request.cost.append(msgs.CostTerm(variable=name.strip(), weight=float(weight)))
    if limit:
        name, above, probability = limit
        request.limits.append(msgs.Limit(variable=name, above=above, below=float("nan"), probability=probability))
    return request


def choice(answer, speeds=SPEEDS):
    """The speed to take, and why. Without a usable answer: the slowest."""
    slowest = min(speeds)
    if answer is None:
        return slowest, "no answer: the slowest speed"
    if not answer.ranking:
        why = answer.message or "; ".join(outlook.text for outlook in answer.outlooks)
        return slowest, f"no speed can be chosen ({why}): the slowest"
    best = answer.ranking[0]
    return speeds[best], answer.outlooks[best].text
