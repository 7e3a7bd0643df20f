/**
 * @file Gains.hpp
 * Gains of one axis as PX4's parameters: written, read back, and put back to what they were.
 */

#pragma once

#include <lib/parameters/param.h>
#include "onecycle.h"

/**
 * PX4's cascade is torque = K (P (A (r - y) - w) + I integral - D dw/dt), with the outer gain A and the inner gains K, P, I, D. With
 * D = 0 it is the tuner's law with kd = K P, ki = K I A and kp = K (P A + I).
 *
 * PX4 filters the torque of yaw with MC_YAW_TQ_CUTOFF, 2 Hz by default. The test acts behind that filter, as PX4's own identification
 * does, so the gains found hold without it: it is switched off with them.
 *
 * Altitude's inner gains are accelerations, which PX4 turns into thrust with the hover thrust.
 */
struct Cascade {
	float outer_p;
	float inner_k;
	float inner_p;
	float inner_i;
	float inner_d;
};

class Gains
{
public:
	/** Finds the axis's parameters (0 roll, 1 pitch, 2 yaw, 3 altitude) and remembers their values. False if one is missing. */
	bool remember(int axis);

	/**
	 * The law found, whose output times `per_input` is PX4's, with no gain above its parameter's maximum. False if its integral
	 * does not fit into this form.
	 */
	bool convert(const onecycle_result &found, float per_input, Cascade &cascade) const;

	/** Writes the gains and reads them back; after a failure the old ones are in force. Not for a realtime thread. */
	bool write(const Cascade &cascade);

	/** Puts the old gains back. */
	bool restore();

	bool is_written() const { return _is_written; }

private:
	static constexpr int COUNT = 6;
	bool set(const float (&values)[COUNT]);

	param_t _params[COUNT] {};
	float _old[COUNT] {};
	int _axis{0};
	bool _is_written{false};
};
