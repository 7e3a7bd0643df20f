/**
 * @file Gains.hpp
 * Gains of one axis as PX4's parameters: written, read back, and put back to what they were.
 */

#pragma once

#include <lib/parameters/param.h>
#include "onecycle.h"

/**
 * PX4's cascade is torque = K (P (A (r - y) - w) + I integral - D dw/dt), with the angle's gain A and the rate's gains K, P, I, D. With
 * D = 0 it is the tuner's law with kd = K P, ki = K I A and kp = K (P A + I).
 *
 * PX4 filters the torque of yaw with MC_YAW_TQ_CUTOFF, 2 Hz by default. The test acts behind that filter, as PX4's own identification
 * does, so the gains found hold without it: it is switched off with them.
 */
struct Cascade {
	float attitude_p;
	float rate_k;
	float rate_p;
	float rate_i;
	float rate_d;
};

class Gains
{
public:
	/** Finds the axis's parameters (0 roll, 1 pitch, 2 yaw) and remembers their values. False if one is missing. */
	bool remember(int axis);

	/** The law found. False if it has no such form, or a gain is outside of its parameter's range; `what` says so. */
	bool convert(const onecycle_result &found, Cascade &cascade, const char *&what) const;

	/** Writes the gains and reads them back; after a failure the old ones are in force. Not for a realtime thread. */
	bool write(const Cascade &cascade);

	/** Puts the old gains back. */
	bool restore();

	bool is_written() const { return _is_written; }

private:
	static constexpr int MOST = 6;
	bool set(const float (&values)[MOST]);

	param_t _params[MOST] {};
	float _old[MOST] {};
	int _count{0};
	bool _is_yaw{false};
	bool _is_written{false};
};
