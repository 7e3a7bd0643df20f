"""The tuner for firmware, called from Python through its C interface (onboard/c/onecycle.h)."""

import pathlib
import re
import subprocess

import cffi

ROOT = pathlib.Path(__file__).resolve().parents[2]


class Interface:
    """The compiled library, described by its header."""

    def __init__(self, archive, scratch):
        header = (ROOT / "onboard/c/onecycle.h").read_text()
        # The header without preprocessor lines and the C++ guard; constants are kept for substitution.
        inside_cpp, lines, constants = False, [], {}
        for line in header.splitlines():
            if line.startswith("#define ") and len(line.split()) == 3:
                constants[line.split()[1]] = line.split()[2]
            if line.startswith("#ifdef __cplusplus"):
                inside_cpp = True
            if not inside_cpp and not line.startswith("#"):
                lines.append(line)
            if line.startswith("#endif"):
                inside_cpp = False
        text = "\n".join(lines)
        for name, value in constants.items():
            text = text.replace(name, value)
        self.ffi = cffi.FFI()
        self.ffi.cdef(text)
        self.constants = {name: int(value) for name, value in constants.items()}
        shared = pathlib.Path(scratch) / "libonecycle.so"
        functions = sorted(set(re.findall(r"\b(onecycle_\w+)\(", text)))
        wanted = [f"-Wl,--undefined={function}" for function in functions]
        subprocess.run(
            ["gcc", "-shared", "-o", shared, *wanted, archive, "-Wl,--gc-sections", "-lm"], check=True
        )
        self.library = self.ffi.dlopen(str(shared))

    def name(self, enum, value):
        return self.ffi.typeof(enum).elements[value].removeprefix("ONECYCLE_").lower()


class Tuner:
    """One axis. Keyword arguments are fields of onecycle_settings."""

    def __init__(self, interface, amplitude, sample_s, **settings):
        self.interface = interface
        ffi, library = interface.ffi, interface.library
        values = ffi.new("onecycle_settings *", library.onecycle_settings_default(amplitude, sample_s))
        for name, value in settings.items():
            setattr(values, name, value)
        self.memory = ffi.new("onecycle_tuner *")
        status = library.onecycle_tuner_init(self.memory, values)
        if status != library.ONECYCLE_STATUS_OK:
            raise ValueError(interface.name("onecycle_status", status))
        self.measurement = ffi.new("onecycle_measurement *", {"has_rate": True})

    def start(self):
        self.interface.library.onecycle_tuner_start(self.memory)

    def step(self, time_s, value, rate, reference):
        self.measurement.value, self.measurement.rate = value, rate
        return self.interface.library.onecycle_tuner_step(
            self.memory, time_s, self.measurement, reference
        )

    @property
    def phase(self):
        phase = self.interface.library.onecycle_tuner_phase(self.memory)
        return self.interface.name("onecycle_phase", phase)

    @property
    def reason(self):
        reason = self.interface.library.onecycle_tuner_reason(self.memory)
        return self.interface.name("onecycle_reason", reason)

    @property
    def result(self):
        """Result of the test, or None."""
        result = self.interface.ffi.new("onecycle_result *")
        found = self.interface.library.onecycle_tuner_result(self.memory, result)
        return result if found else None
