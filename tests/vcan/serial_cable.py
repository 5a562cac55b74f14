"""A serial line between a program and an emulated board: a pseudo terminal on one side, the emulator's socket on the other."""

import os
import pty
import select
import socket
import threading
import time
import tty
import zlib

PACKET_BYTES = 8208  # of a beat frame; see hal/common/beat_link.hpp
HEADER_BYTES = 12


class SerialCable:
    """Carries both ways between the terminal `device` and a socket. What goes wrong is `fault`:

    "flip"   one bit of the next beat packet is flipped, once
    "blank"  the samples of the next beat packet are zero and its checksum right: the board gets another frame than was sent
    "cut"    bytes to the board vanish
    "stuck"  no bytes to the board are taken
    """

    def __init__(self, connection):
        self.master, slave = pty.openpty()
        tty.setraw(self.master)
        self.device = os.ttyname(slave)
        self.slave = slave  # kept open, so that the terminal survives between two users
        self.connection = connection
        connection.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, 4096)  # a cable holds no frames
        self.fault = None
        threading.Thread(target=self._to_board, daemon=True).start()
        threading.Thread(target=self._from_board, daemon=True).start()

    def _to_board(self):
        held = bytearray()
        while True:
            if self.fault == "stuck":
                time.sleep(0.05)
                continue
            if not select.select([self.master], [], [], 0.1)[0]:
                continue
            held += os.read(self.master, 65536)
            if self.fault == "cut":
                held.clear()
            if self.fault in ("flip", "blank"):
                if len(held) < PACKET_BYTES:
                    continue
                if self.fault == "flip":
                    held[5000] ^= 0x10
                else:
                    held[HEADER_BYTES:PACKET_BYTES - 4] = bytes(PACKET_BYTES - HEADER_BYTES - 4)
                    held[PACKET_BYTES - 4:PACKET_BYTES] = zlib.crc32(held[4:PACKET_BYTES - 4]).to_bytes(4, "little")
                self.fault = None
            try:
                self.connection.sendall(held)
            except OSError:
                pass  # the board is gone; an adapter takes bytes all the same
            held.clear()

    def _from_board(self):
        try:
            while data := self.connection.recv(4096):
                os.write(self.master, data)
        except OSError:
            pass
