/**
 * @file Notes.hpp
 * What the module tells the operator: a status text, and a PX4 event that ground stations translate.
 */

#pragma once

#include <uORB/uORB.h>

#include "Gains.hpp"
#include "onecycle.h"

/** Why a test ends without gains, or why they are taken back. */
enum class Why : uint8_t {
	None,
	Operator,
	Disarmed,
	Mode,
	Motor,
	Reset,
	Stalled,
	Stick,
	Tuner,      // the tuner's own reason
	Form,       // the integral does not fit into the cascade
	Write,
	Lacks,
	Unanswered,
	Limit,
	Settings,
	Ground,
	Failsafe,
	NoAttitude,
	NoHeight,
	NotVtol,
};

class Notes
{
public:
	void noTest(Why why);
	void begins(int axis);
	void found(int axis, const onecycle_result &found);
	void proposes(int axis, const Cascade &cascade);
	void waits(int axis);
	void tuned(int axis, const Cascade &cascade);

	/** The test ended and the old gains are in force; the last two are those of `Why::Tuner`. */
	void ended(int axis, Why why, onecycle_reason reason, const char *reason_text);
	void restored(int axis, bool is_restored);
	void kept();
	void finished();
	void cannotRecord(const char *path);

private:
	orb_advert_t _mavlink_log_pub{nullptr};
};
