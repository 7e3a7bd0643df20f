"""Puts the onecycle backend of AC_CustomControl into a checkout of ArduPilot. Applying it again changes nothing.

    python apply.py ARDUPILOT_DIR

Copies the backend and onecycle.h, and registers the backend in five files of ArduPilot. Says so and changes nothing if a
place in them is not found: then this ArduPilot is too different from the one this was written for.
"""

import pathlib
import shutil
import sys

HERE = pathlib.Path(__file__).resolve().parent
HEADER = HERE.parent.parent / "onboard/c/onecycle.h"
PACK = HERE.parent / "margin_35.pack"
LIBRARY = "libraries/AC_CustomControl/"

# (file, text that is there once, text in its place)
CHANGES = [
    (LIBRARY + "AC_CustomControl_config.h", "#ifndef AP_CUSTOMCONTROL_PID_ENABLED\n",
     "#ifndef AP_CUSTOMCONTROL_ONECYCLE_ENABLED\n"
     "#define AP_CUSTOMCONTROL_ONECYCLE_ENABLED AP_CUSTOMCONTROL_BACKEND_DEFAULT_ENABLED\n"
     "#endif\n\n"
     "#ifndef AP_CUSTOMCONTROL_PID_ENABLED\n"),
    (LIBRARY + "AC_CustomControl_Backend.h", '#include "AC_CustomControl.h"\n',
     '#include <RC_Channel/RC_Channel.h>\n\n#include "AC_CustomControl.h"\n'),
    (LIBRARY + "AC_CustomControl_Backend.h", "    virtual void reset() = 0;\n",
     "    virtual void reset() = 0;\n\n"
     "    // bits of the axes whose motor input this controller sets; the others stay with the main controller\n"
     "    virtual uint8_t axes_in_charge() const { return 0xFF; }\n\n"
     "    // three-position switch; returns whether update() has to run\n"
     "    virtual bool aux_switch(RC_Channel::AuxSwitchPos position, uint8_t axis_mask) { return false; }\n"),
    (LIBRARY + "AC_CustomControl.h", "#define CUSTOMCONTROL_MAX_TYPES 2\n", "#define CUSTOMCONTROL_MAX_TYPES 3\n"),
    (LIBRARY + "AC_CustomControl.h", "#include <AP_Motors/AP_MotorsMulticopter.h>\n",
     "#include <AP_Motors/AP_MotorsMulticopter.h>\n#include <RC_Channel/RC_Channel.h>\n"),
    (LIBRARY + "AC_CustomControl.h", "    void set_custom_controller(bool enabled);\n",
     "    void set_custom_controller(bool enabled);\n    void aux_switch(RC_Channel::AuxSwitchPos position);\n"),
    (LIBRARY + "AC_CustomControl.h", "        CONT_PID             = 2,\n",
     "        CONT_PID             = 2,\n        CONT_ONECYCLE        = 3,\n"),
    (LIBRARY + "AC_CustomControl.cpp", '#include "AC_CustomControl_PID.h"\n',
     '#include "AC_CustomControl_PID.h"\n#include "AC_CustomControl_Onecycle.h"\n'),
    (LIBRARY + "AC_CustomControl.cpp", "// @Values: 0:None, 1:Empty, 2:PID\n", "// @Values: 0:None, 1:Empty, 2:PID, 3:Onecycle\n"),
    (LIBRARY + "AC_CustomControl.cpp", '"2_", 7, AC_CustomControl, _backend_var_info[1]),\n',
     '"2_", 7, AC_CustomControl, _backend_var_info[1]),\n\n'
     "    // parameters for onecycle\n"
     '    AP_SUBGROUPVARPTR(_backend, "3_", 8, AC_CustomControl, _backend_var_info[2]),\n'),
    (LIBRARY + "AC_CustomControl.cpp", "        default:\n            return;\n",
     "        case CustomControlType::CONT_ONECYCLE:\n"
     "            _backend = NEW_NOTHROW AC_CustomControl_Onecycle(*this, _ahrs, _att_control, _motors, _dt);\n"
     "            _backend_var_info[get_type()] = AC_CustomControl_Onecycle::var_info;\n"
     "            break;\n"
     "        default:\n            return;\n"),
    (LIBRARY + "AC_CustomControl.cpp", "void AC_CustomControl::motor_set(Vector3f rpy) {\n",
     "void AC_CustomControl::motor_set(Vector3f rpy) {\n"
     "    const uint8_t axes = _custom_controller_mask & _backend->axes_in_charge();\n"),
    *[(LIBRARY + "AC_CustomControl.cpp", f"(_custom_controller_mask & (uint8_t)CustomControlOption::{axis})",
       f"(axes & (uint8_t)CustomControlOption::{axis})") for axis in ("ROLL", "PITCH", "YAW")],
    (LIBRARY + "AC_CustomControl.cpp", "// check that RC switch is on, ",
     "// backends with a three-position switch take all of them, the others are on when it is high\n"
     "void AC_CustomControl::aux_switch(RC_Channel::AuxSwitchPos position)\n"
     "{\n"
     "    if (_backend == nullptr || CustomControlType(_controller_type) != CustomControlType::CONT_ONECYCLE) {\n"
     "        set_custom_controller(position == RC_Channel::AuxSwitchPos::HIGH);\n"
     "        return;\n"
     "    }\n"
     "    log_switch();\n"
     "    _custom_controller_active = _backend->aux_switch(position, _custom_controller_mask);\n"
     "    log_switch();\n"
     "}\n\n"
     "// check that RC switch is on, "),
    ("ArduCopter/RC_Channel_Copter.cpp", "custom_control.set_custom_controller(ch_flag == AuxSwitchPos::HIGH);",
     "custom_control.aux_switch(ch_flag);"),
]


def apply(root):
    """Registers the backend; returns a problem or None."""
    texts = {}
    for name, old, new in CHANGES:
        path = root / name
        if name not in texts:
            if not path.exists():
                return f"{path} is missing: is {root} a checkout of ArduPilot?"
            texts[name] = path.read_text()
        if new in texts[name]:
            continue
        if texts[name].count(old) != 1:
            return f"{name}: not the place expected for the change of: {old.strip()}"
        texts[name] = texts[name].replace(old, new)
    for name, text in texts.items():
        if (root / name).read_text() != text:
            (root / name).write_text(text)
    for file in [*(HERE / "firmware").glob("*.*"), HEADER]:
        target = root / LIBRARY / file.name
        if not target.exists() or target.read_bytes() != file.read_bytes():
            shutil.copyfile(file, target)
    pack = "static const uint8_t MARGIN_35_PACK[] {" + ",".join(map(str, PACK.read_bytes())) + "};\n"
    target = root / LIBRARY / "onecycle_pack.h"
    if not target.exists() or target.read_text() != pack:
        target.write_text(pack)
    return None


if __name__ == "__main__":
    if len(sys.argv) != 2:
        sys.exit("usage: python apply.py ARDUPILOT_DIR")
    if problem := apply(pathlib.Path(sys.argv[1])):
        sys.exit(f"apply: {problem}")
