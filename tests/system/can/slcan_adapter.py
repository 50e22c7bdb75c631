# SPDX-License-Identifier: GPL-2.0-or-later
"""A CAN adapter on a serial line (slcan), played on a pseudo-terminal: for the kernel's driver it is a controller, whose
states and error counters are what is said here. The interface appears in the network of init."""
import fcntl
import os
import pty
import struct
import subprocess
import termios
import threading
import tty

N_SLCAN = 17


def interfaces():
    return set(os.listdir("/sys/class/net"))


class Adapter:
    def __enter__(self):
        self.line, self.driver = pty.openpty()
        tty.setraw(self.line)
        tty.setraw(self.driver)
        before = interfaces()
        fcntl.ioctl(self.driver, termios.TIOCSETD, struct.pack("i", N_SLCAN))
        self.interface, = interfaces() - before
        self.heard = []  # lines of the driver
        self.reader = threading.Thread(target=self.read, daemon=True)
        self.reader.start()
        for command in ["type", "can", "bitrate", "500000"], ["up"]:
            subprocess.run(["ip", "link", "set", self.interface] + command, check=True)
        return self

    def __exit__(self, *error):
        subprocess.run(["ip", "link", "set", self.interface, "down"], check=False)
        os.close(self.driver)  # which removes the interface
        os.close(self.line)
        self.reader.join()

    def read(self):
        rest = b""
        while True:
            try:
                *lines, rest = (rest + os.read(self.line, 4096)).split(b"\r")
            except OSError:
                return
            self.heard += lines

    def say(self, line):
        os.write(self.line, line.encode() + b"\r")

    def count(self, line):
        return self.heard.count(line.encode())

    def change_state(self, state, receive_errors, transmit_errors):
        """state: a(ctive), w(arning), p(assive), b(us-off)."""
        self.say(f"s{state}{receive_errors:03}{transmit_errors:03}")
