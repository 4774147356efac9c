#!/usr/bin/env python3
"""A planner in rospy: asks twice a second what three speeds lead to, and publishes the best as a speed limit."""

import os
import sys

import rospy
import roscausal_msgs.msg as msgs
from roscausal_msgs.srv import WhatIf, WhatIfRequest
from std_msgs.msg import Float64

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from choose import choice, question


def main():
    rospy.init_node("planner")
    limits = rospy.Publisher("/speed_limit", Float64, queue_size=1)
    # For robots that take a factor of their own top speed, such as the simulator's; 0: none.
    own_speed = rospy.get_param("~own_speed", 0.0)
    factors = rospy.Publisher("twist_mux/scaling_factor", Float64, queue_size=1) if own_speed > 0 else None
    variable = rospy.get_param("~variable", "r_v")
    cost = rospy.get_param("~cost", ["h_risk=1.0", "r_v=-0.2"])
    what_if = rospy.ServiceProxy("/roscausal/what_if", WhatIf)
    rate, said = rospy.Rate(2), None
    while not rospy.is_shutdown():
        try:
            answer = what_if(question(msgs, WhatIfRequest(), variable, cost=cost))
        except rospy.ServiceException:
            answer = None
        speed, why = choice(answer)
        limits.publish(speed)
        if factors:
            factors.publish(speed / own_speed)
        if speed != said:
            rospy.loginfo("speed limit %g m/s: %s", speed, why)
            said = speed
        rate.sleep()


if __name__ == "__main__":
    try:
        main()
    except rospy.ROSInterruptException:
        pass
