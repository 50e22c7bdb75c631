# SPDX-License-Identifier: GPL-2.0-or-later
"""A CANopen node with a drive of the profile CiA 402, simulated on a bus of python-can: the other end of
examples/cia402.dbc. It takes its process data with SYNC and answers with its own; a millisecond goes by from one SYNC to
the next."""
import struct
import threading
import time

import can

STATES = {"not ready": 0x00, "switch on disabled": 0x40, "ready to switch on": 0x21, "switched on": 0x23,
          "operation enabled": 0x27, "quick stop active": 0x07, "fault": 0x08}
# The commands that a state obeys, with mask and bits of the controlword, and what comes then.
OFF, STOP = (0x02, 0x00, "switch on disabled"), (0x06, 0x02, "switch on disabled")
TRANSITIONS = {
    "switch on disabled": [(0x07, 0x06, "ready to switch on")],
    "ready to switch on": [OFF, STOP, (0x07, 0x07, "switched on")],
    "switched on": [OFF, STOP, (0x07, 0x06, "ready to switch on"), (0x0F, 0x0F, "operation enabled")],
    "operation enabled": [OFF, (0x06, 0x02, "quick stop active"), (0x07, 0x06, "ready to switch on"),
                          (0x0F, 0x07, "switched on")],
    "quick stop active": [OFF],
}
HOMING_SYNCS = 20


class Node(threading.Thread):
    """number: of the node. Attributes may be changed while it runs: heartbeats, guarded, host_timeout_s."""

    def __init__(self, channel, number=1, host=127):
        super().__init__(daemon=True)
        self.bus = can.Bus(interface="socketcan", channel=channel)
        self.number, self.host = number, host
        self.heartbeats, self.guarded, self.toggle_stuck, self.host_timeout_s = True, False, False, None
        self.passed = []  # states, in their order
        self.ends = False
        self.orders = []  # of other threads
        self.boot()
        self.start()

    def boot(self):
        self.nmt = 127
        self.state = "switch on disabled"
        self.error = 0
        self.mode, self.position, self.velocity, self.toggle = 0, 0, 0, 0
        self.receive = {0x200: bytes(7), 0x300: bytes(4)}
        self.controlword = 0
        self.homing_syncs = None  # still to go
        self.heard_host = time.monotonic()
        self.beat_due = 0.0
        self.send(0x700, b"\0")

    def send(self, function, data):
        try:
            self.bus.send(can.Message(arbitration_id=function + (self.number if function >= 0x80 else 0), data=data,
                                      is_extended_id=False))
        except can.CanError:
            pass  # the interface is down

    def order(self, what):
        """Have the node's thread do something."""
        self.orders.append(what)

    def fail(self, code):
        self.error = code
        self.state = "fault"
        self.velocity = 0
        self.send(0x80, struct.pack("<HB5x", code, 1))

    def close(self):
        self.ends = True
        self.join()
        self.bus.shutdown()

    def run(self):
        while not self.ends:
            message = self.bus.recv(0.01)
            while self.orders:
                self.orders.pop(0)()
            if message and not message.is_error_frame:
                self.take(message)
            self.look_at_time()

    def look_at_time(self):
        now = time.monotonic()
        if self.heartbeats and not self.guarded and now >= self.beat_due:
            self.beat_due = now + 0.1
            self.send(0x700, bytes([self.nmt]))
        if self.host_timeout_s and self.state != "fault" and now - self.heard_host > self.host_timeout_s:
            self.fail(0x8130)

    def take(self, message):
        identifier, data = message.arbitration_id, bytes(message.data)
        if identifier == 0x700 + self.number and message.is_remote_frame and self.guarded and self.heartbeats:
            self.send(0x700, bytes([self.nmt | self.toggle]))
            self.toggle ^= 0 if self.toggle_stuck else 0x80
        elif identifier == 0x700 + self.host:
            self.heard_host = time.monotonic()
        elif identifier == 0 and data[1] in (0, self.number):
            self.nmt = {1: 5, 2: 4, 128: 127}.get(data[0], self.nmt)
        elif identifier - self.number in self.receive and self.nmt == 5:
            self.receive[identifier - self.number] = data
        elif identifier == 0x80 and self.nmt == 5:
            self.sync()

    def sync(self):
        controlword, target, mode = struct.unpack("<Hib", self.receive[0x200])
        target_velocity, = struct.unpack("<i", self.receive[0x300])
        self.obey(controlword)
        self.mode = mode
        attained = self.move(controlword, target, target_velocity)
        word = STATES[self.state] | 0x0200 | (0x1400 if attained else 0) | (0x10 if self.state in (
            "switched on", "operation enabled") else 0)
        self.controlword = controlword
        self.send(0x180, struct.pack("<Hib", word, self.position, self.mode))
        self.send(0x280, struct.pack("<i", round(self.velocity)))

    def obey(self, controlword):
        before = self.state
        if self.state == "fault" and controlword & 0x80 and not self.controlword & 0x80:
            self.state, self.error = "switch on disabled", 0
        for mask, bits, after in TRANSITIONS.get(self.state, []):
            if controlword & mask == bits:
                self.state = after
                break
        if self.state != before:
            self.passed.append(self.state)

    def move(self, controlword, target, target_velocity):
        """A millisecond. Whether it has attained its home."""
        before, self.velocity = self.position, 0
        if self.state != "operation enabled":
            self.homing_syncs = None
        elif self.mode == 8:
            self.position = target
            self.velocity = (self.position - before) * 1000
        elif self.mode in (3, 9):
            self.velocity = target_velocity
            self.position += round(target_velocity / 1000)
        elif self.mode == 6 and controlword & 0x10:
            if not self.controlword & 0x10:
                self.homing_syncs = HOMING_SYNCS
            if self.homing_syncs:
                self.homing_syncs -= 1
                self.position = 0 if self.homing_syncs == 0 else self.position
        return self.mode == 6 and self.homing_syncs == 0
