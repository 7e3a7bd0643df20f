#include "Notes.hpp"

#include <px4_platform_common/events.h>
#include <px4_platform_common/log.h>
#include <systemlib/mavlink_log.h>

#include "Axis.hpp"

// A tab at the end of a status text tells the ground station that an event says the same.

namespace
{
const events::LogLevels CRITICAL{events::Log::Critical, events::LogInternal::Info};
const events::LogLevels INFO{events::Log::Info, events::LogInternal::Info};

const char *text(Why why)
{
	switch (why) {
	case Why::Operator: return "aborted by the operator";

	case Why::Disarmed: return "disarmed";

	case Why::Mode: return "the flight mode changed, or a failsafe began";

	case Why::Motor: return "the failure detector reports a motor";

	case Why::Reset: return "the estimator was reset";

	case Why::Stalled: return "the control loop has stopped";

	case Why::Stick: return "a stick was moved";

	case Why::Form: return "its integral does not fit into PX4's cascade";

	case Why::Write: return "a parameter could not be written";

	case Why::Lacks: return "the firmware lacks one of its gains";

	case Why::Unanswered: return "nobody accepted the gains";

	case Why::Limit: return "the output was at its limit with the new gains";

	case Why::Settings: return "settings refused: check OC_* and the limits";

	case Why::Ground: return "the vehicle is not flying: hover first";

	case Why::Failsafe: return "a failsafe is active";

	case Why::NoAttitude: return "there is no attitude";

	case Why::NoHeight: return "there is no height";

	case Why::NotVtol: return "mc_rate_control was not started as vtol";

	case Why::None:
	case Why::Tuner: break;
	}

	return "";
}

void sendEnded(uint8_t axis, onecycle_reason reason)
{
	switch (reason) {
	case ONECYCLE_REASON_NOT_FINITE:
		events::send<uint8_t>(events::ID("onecycle_ended_not_finite"), CRITICAL,
				      "onecycle: axis {1}: a time, a reference or a measurement is not finite; old gains in force", axis);
		break;

	case ONECYCLE_REASON_STALE:
		events::send<uint8_t>(events::ID("onecycle_ended_stale"), CRITICAL,
				      "onecycle: axis {1}: a sample is too old, or the timestamp did not increase; old gains in force", axis);
		break;

	case ONECYCLE_REASON_EXCURSION:
		events::send<uint8_t>(events::ID("onecycle_ended_excursion"), CRITICAL,
				      "onecycle: axis {1}: the output is too far from the reference; old gains in force", axis);
		break;

	case ONECYCLE_REASON_RATE:
		events::send<uint8_t>(events::ID("onecycle_ended_rate"), CRITICAL,
				      "onecycle: axis {1}: the output moves too fast; old gains in force", axis);
		break;

	case ONECYCLE_REASON_DURATION:
		events::send<uint8_t>(events::ID("onecycle_ended_duration"), CRITICAL,
				      "onecycle: axis {1}: the test takes too long; old gains in force", axis);
		break;

	case ONECYCLE_REASON_NO_OSCILLATION:
		events::send<uint8_t>(events::ID("onecycle_ended_no_oscillation"), CRITICAL,
				      "onecycle: axis {1}: the relay has not switched for too long; old gains in force", axis);
		break;

	case ONECYCLE_REASON_MISMATCH:
		events::send<uint8_t>(events::ID("onecycle_ended_mismatch"), CRITICAL,
				      "onecycle: axis {1}: the response with the new gains differs from the prediction; old gains in force", axis);
		break;

	case ONECYCLE_REASON_AMPLITUDE_DEPENDENT:
		events::send<uint8_t>(events::ID("onecycle_ended_amplitude"), CRITICAL,
				      "onecycle: axis {1}: the gain depends on the amplitude; old gains in force", axis);
		break;

	case ONECYCLE_REASON_NO_SIGNATURE:
		events::send<uint8_t>(events::ID("onecycle_ended_no_signature"), CRITICAL,
				      "onecycle: axis {1}: the last cycle is constant or lacks samples; old gains in force", axis);
		break;

	case ONECYCLE_REASON_UNKNOWN:
		events::send<uint8_t>(events::ID("onecycle_ended_unknown"), CRITICAL,
				      "onecycle: axis {1}: no process of this family explains the last cycle; old gains in force", axis);
		break;

	case ONECYCLE_REASON_NO_FIT:
		events::send<uint8_t>(events::ID("onecycle_ended_no_fit"), CRITICAL,
				      "onecycle: axis {1}: the output does not follow the input; old gains in force", axis);
		break;

	case ONECYCLE_REASON_MISFIT:
		events::send<uint8_t>(events::ID("onecycle_ended_misfit"), CRITICAL,
				      "onecycle: axis {1}: the best fit leaves part of the oscillation unexplained; old gains in force", axis);
		break;

	case ONECYCLE_REASON_EDGE:
		events::send<uint8_t>(events::ID("onecycle_ended_edge"), CRITICAL,
				      "onecycle: axis {1}: the best fit lies on a limit of the domain; old gains in force", axis);
		break;

	case ONECYCLE_REASON_NO_GAINS:
		events::send<uint8_t>(events::ID("onecycle_ended_no_gains"), CRITICAL,
				      "onecycle: axis {1}: there are no gains for this process; old gains in force", axis);
		break;

	case ONECYCLE_REASON_TOO_UNCERTAIN:
		events::send<uint8_t>(events::ID("onecycle_ended_uncertain"), CRITICAL,
				      "onecycle: axis {1}: the phase margin is too uncertain; old gains in force", axis);
		break;

	default:
		events::send<uint8_t>(events::ID("onecycle_ended_refused"), CRITICAL,
				      "onecycle: axis {1}: no controller found; old gains in force", axis);
	}
}

void sendEnded(uint8_t axis, Why why)
{
	switch (why) {
	case Why::Operator:
		events::send<uint8_t>(events::ID("onecycle_ended_operator"), CRITICAL,
				      "onecycle: axis {1}: aborted by the operator; old gains in force", axis);
		break;

	case Why::Disarmed:
		events::send<uint8_t>(events::ID("onecycle_ended_disarmed"), CRITICAL,
				      "onecycle: axis {1}: disarmed; old gains in force", axis);
		break;

	case Why::Mode:
		events::send<uint8_t>(events::ID("onecycle_ended_mode"), CRITICAL,
				      "onecycle: axis {1}: the flight mode changed, or a failsafe began; old gains in force", axis);
		break;

	case Why::Motor:
		events::send<uint8_t>(events::ID("onecycle_ended_motor"), CRITICAL,
				      "onecycle: axis {1}: the failure detector reports a motor; old gains in force", axis);
		break;

	case Why::Reset:
		events::send<uint8_t>(events::ID("onecycle_ended_reset"), CRITICAL,
				      "onecycle: axis {1}: the estimator was reset; old gains in force", axis);
		break;

	case Why::Stalled:
		events::send<uint8_t>(events::ID("onecycle_ended_stalled"), CRITICAL,
				      "onecycle: axis {1}: the control loop has stopped; old gains in force", axis);
		break;

	case Why::Stick:
		events::send<uint8_t>(events::ID("onecycle_ended_stick"), CRITICAL,
				      "onecycle: axis {1}: a stick was moved; old gains in force", axis);
		break;

	case Why::Form:
		events::send<uint8_t>(events::ID("onecycle_ended_form"), CRITICAL,
				      "onecycle: axis {1}: its integral does not fit into PX4's cascade; old gains in force", axis);
		break;

	case Why::Write:
		events::send<uint8_t>(events::ID("onecycle_ended_write"), CRITICAL,
				      "onecycle: axis {1}: a parameter could not be written; old gains in force", axis);
		break;

	case Why::Lacks:
		events::send<uint8_t>(events::ID("onecycle_ended_lacks"), CRITICAL,
				      "onecycle: axis {1}: the firmware lacks one of its gains; old gains in force", axis);
		break;

	case Why::Unanswered:
		events::send<uint8_t>(events::ID("onecycle_ended_unanswered"), CRITICAL,
				      "onecycle: axis {1}: nobody accepted the gains; old gains in force", axis);
		break;

	case Why::Limit:
		events::send<uint8_t>(events::ID("onecycle_ended_limit"), CRITICAL,
				      "onecycle: axis {1}: the output was at its limit with the new gains; old gains in force", axis);
		break;

	case Why::Settings:
		events::send<uint8_t>(events::ID("onecycle_ended_settings"), CRITICAL,
				      "onecycle: axis {1}: settings refused: check OC_* and the limits; old gains in force", axis);
		break;

	default:
		break;
	}
}

void sendNoTest(Why why)
{
	switch (why) {
	case Why::Ground:
		events::send(events::ID("onecycle_no_test_ground"), CRITICAL,
			     "onecycle: no test: the vehicle is not flying: hover first");
		break;

	case Why::Failsafe:
		events::send(events::ID("onecycle_no_test_failsafe"), CRITICAL,
			     "onecycle: no test: a failsafe is active");
		break;

	case Why::NoAttitude:
		events::send(events::ID("onecycle_no_test_attitude"), CRITICAL,
			     "onecycle: no test: there is no attitude");
		break;

	case Why::NoHeight:
		events::send(events::ID("onecycle_no_test_height"), CRITICAL,
			     "onecycle: no test: there is no height");
		break;

	case Why::NotVtol:
		events::send(events::ID("onecycle_no_test_vtol"), CRITICAL,
			     "onecycle: no test: mc_rate_control was not started as vtol");
		break;

	default:
		break;
	}
}
}

void Notes::noTest(Why why)
{
	mavlink_log_critical(&_mavlink_log_pub, "onecycle: no test: %s\t", text(why));
	sendNoTest(why);
}

void Notes::begins(int axis)
{
	mavlink_log_info(&_mavlink_log_pub, "onecycle: %s: test begins, hands off\t", Axis::name(axis));
	/* EVENT
	 * @description Axes: 0 roll, 1 pitch, 2 yaw, 3 altitude. A moved stick or another flight mode ends the test.
	 */
	events::send<uint8_t>(events::ID("onecycle_begins"), INFO, "onecycle: test of axis {1} begins, hands off", axis);
}

void Notes::found(int axis, const onecycle_result &found)
{
	mavlink_log_info(&_mavlink_log_pub, "onecycle: %s: gain %.1f (%.0f %%), lag %.0f ms, dead time %.1f ms\t", Axis::name(axis),
			 found.k_over_t_body, 100 * found.k_over_t_body_deviation, 1e3 * found.t_prop_s, 1e3 * found.tau_s);
	events::send<uint8_t, float, float, float>(events::ID("onecycle_found"), INFO,
			"onecycle: axis {1}: gain {2:.1}, lag {3:.0} ms, dead time {4:.1} ms", axis, (float)found.k_over_t_body,
			(float)(1e3 * found.t_prop_s), (float)(1e3 * found.tau_s));
}

void Notes::proposes(int axis, const Cascade &cascade)
{
	mavlink_log_info(&_mavlink_log_pub, "onecycle: %s: proposes P %.2f, inner K %.2f P %.3f I %.3f D 0\t", Axis::name(axis),
			 (double)cascade.outer_p, (double)cascade.inner_k, (double)cascade.inner_p, (double)cascade.inner_i);
	events::send<uint8_t, float, float, float, float>(events::ID("onecycle_proposes"), INFO,
			"onecycle: axis {1}: proposes P {2:.2}, inner K {3:.2} P {4:.3} I {5:.3}", axis, cascade.outer_p, cascade.inner_k,
			cascade.inner_p, cascade.inner_i);
}

void Notes::waits(int axis)
{
	mavlink_log_info(&_mavlink_log_pub, "onecycle: %s: set OC_ACCEPT to 1 to fly these gains\t", Axis::name(axis));
	events::send<uint8_t>(events::ID("onecycle_waits"), INFO, "onecycle: axis {1}: set OC_ACCEPT to 1 to fly these gains", axis);
}

void Notes::tuned(int axis, const Cascade &cascade)
{
	mavlink_log_info(&_mavlink_log_pub, "onecycle: %s: tuned, P %.2f, inner K %.2f P %.3f I %.3f D 0\t", Axis::name(axis),
			 (double)cascade.outer_p, (double)cascade.inner_k, (double)cascade.inner_p, (double)cascade.inner_i);
	events::send<uint8_t, float, float, float, float>(events::ID("onecycle_tuned"), INFO,
			"onecycle: axis {1}: tuned, P {2:.2}, inner K {3:.2} P {4:.3} I {5:.3}", axis, cascade.outer_p, cascade.inner_k,
			cascade.inner_p, cascade.inner_i);
}

void Notes::ended(int axis, Why why, onecycle_reason reason, const char *reason_text)
{
	mavlink_log_critical(&_mavlink_log_pub, "onecycle: %s: %s; the old gains are in force\t", Axis::name(axis),
			     why == Why::Tuner ? reason_text : text(why));

	if (why == Why::Tuner) {
		sendEnded(axis, reason);

	} else {
		sendEnded(axis, why);
	}
}

void Notes::restored(int axis, bool is_restored)
{
	if (is_restored) {
		mavlink_log_critical(&_mavlink_log_pub, "onecycle: %s: not accepted, the old gains are in force\t", Axis::name(axis));
		events::send<uint8_t>(events::ID("onecycle_not_accepted"), CRITICAL,
				      "onecycle: axis {1}: not accepted, the old gains are in force", axis);

	} else {
		mavlink_log_critical(&_mavlink_log_pub, "onecycle: %s: the old gains could not be written\t", Axis::name(axis));
		events::send<uint8_t>(events::ID("onecycle_not_restored"), CRITICAL,
				      "onecycle: axis {1}: the old gains could not be written", axis);
	}
}

void Notes::kept()
{
	mavlink_log_info(&_mavlink_log_pub, "onecycle: gains are kept\t");
	events::send(events::ID("onecycle_kept"), INFO, "onecycle: gains are kept");
}

void Notes::finished()
{
	mavlink_log_info(&_mavlink_log_pub, "onecycle: finished\t");
	events::send(events::ID("onecycle_finished"), INFO, "onecycle: finished");
}

void Notes::cannotRecord(const char *path)
{
	mavlink_log_critical(&_mavlink_log_pub, "onecycle: cannot write %s", path);
}
