#!/usr/bin/env python3
"""A planner in rclpy: asks twice a second what three speeds lead to, and publishes the best as a speed limit."""

import os
import sys
import time

import rclpy
import roscausal_msgs.msg as msgs
from nav2_msgs.msg import SpeedLimit
from rclpy.executors import ExternalShutdownException
from rclpy.node import Node
from roscausal_msgs.srv import WhatIf
from std_msgs.msg import Float64

sys.path.insert(0, os.path.dirname(os.path.abspath(__file__)))
from choose import choice, question

# A question that has no answer after this long is lost; seconds.
PATIENCE = 2.0


class Planner(Node):
    def __init__(self):
        super().__init__("planner")
        self.variable = self.declare_parameter("variable", "r_v").value
        self.cost = self.declare_parameter("cost", ["h_risk=1.0", "r_v=-0.2"]).value
        self.limits = self.create_publisher(SpeedLimit, "/speed_limit", 1)
        # For robots that take a factor of their own top speed, such as the simulator's; 0: none.
        self.own_speed = self.declare_parameter("own_speed", 0.0).value
        self.factors = self.create_publisher(Float64, "twist_mux/scaling_factor", 1) if self.own_speed > 0 else None
        self.what_if = self.create_client(WhatIf, "/roscausal/what_if")
        self.open, self.asked, self.said = None, 0.0, None
        self.create_timer(0.5, self.ask)

    def ask(self):
        if self.open is not None and time.monotonic() - self.asked < PATIENCE:
            return
        if self.open is not None:
            self.what_if.remove_pending_request(self.open)
            self.take(None)
        self.open = None
        if not self.what_if.service_is_ready():
            return self.take(None)
        self.open, self.asked = self.what_if.call_async(question(msgs, WhatIf.Request(), self.variable, cost=self.cost)), time.monotonic()
        self.open.add_done_callback(self.answered)

    def answered(self, future):
        if future is self.open:
            self.open = None
            self.take(future.result())

    def take(self, answer):
        speed, why = choice(answer)
        self.limits.publish(SpeedLimit(speed_limit=speed))
        if self.factors:
            self.factors.publish(Float64(data=speed / self.own_speed))
        if speed != self.said:
            self.get_logger().info(f"speed limit {speed:g} m/s: {why}")
            self.said = speed


def main():
    rclpy.init()
    try:
        rclpy.spin(Planner())
    except (KeyboardInterrupt, ExternalShutdownException):
        pass


if __name__ == "__main__":
    main()
