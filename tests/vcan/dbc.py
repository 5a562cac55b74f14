"""Frames by can/radar.dbc, written from the DBC and the AUTOSAR document alone, so that the tests do not believe the
firmware's own codec. Intel signals only; E2E profile 11, data id mode "both": CRC-8 0x1D over the data id, low byte
first, and all bytes after the CRC."""

import re


class Dbc:
    def __init__(self, path):
        self.messages = {}  # name: (id, length, {signal: (start, length, signed)})
        with open(path, encoding="utf-8") as file:
            for line in file:
                if m := re.match(r"BO_ (\d+) (\w+): (\d+)", line):
                    signals = {}
                    self.messages[m[2]] = (int(m[1]), int(m[3]), signals)
                elif m := re.match(r" SG_ (\w+) : (\d+)\|(\d+)@1([+-])", line):
                    signals[m[1]] = (int(m[2]), int(m[3]), m[4] == "-")

    def encode(self, name, counter, **raw):
        """(identifier, payload), protected. Values are counts."""
        can_id, length, signals = self.messages[name]
        bits = 0
        for signal, value in {"Counter": counter, **raw}.items():
            start, size, _ = signals[signal]
            bits |= (value & ((1 << size) - 1)) << start
        payload = bytearray(bits.to_bytes(length, "little"))
        payload[0] = crc(can_id, payload)
        return can_id, bytes(payload)

    def decode(self, name, payload):
        """Counts of all signals; None if the length or the CRC is wrong."""
        can_id, length, signals = self.messages[name]
        if len(payload) != length or payload[0] != crc(can_id, payload):
            return None
        bits = int.from_bytes(payload, "little")
        values = {}
        for signal, (start, size, signed) in signals.items():
            value = bits >> start & ((1 << size) - 1)
            values[signal] = value - (1 << size) if signed and value >> (size - 1) else value
        return values


def crc(data_id, payload):
    value = 0
    for byte in bytes((data_id & 0xFF, data_id >> 8)) + bytes(payload[1:]):
        value ^= byte
        for _ in range(8):
            value = (value << 1 ^ 0x1D) & 0xFF if value & 0x80 else value << 1
    return value
